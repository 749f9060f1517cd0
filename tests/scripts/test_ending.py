"""Every command ends in a summary or in one line, whatever its streams are and whatever stops it."""

import os
import signal
import subprocess
import sys

import pytest
from repository import ENVIRONMENT, REPOSITORY, command

from scripts.command import LONGEST_LINE, one_line

VERB = """
import dataclasses, sys, time
sys.path.insert(0, {repository!r})
from scripts.command import Summary, run_verb
@dataclasses.dataclass(frozen=True)
class Nothing:
    "Do nothing."
    json: bool = False
    "Print the summary as one JSON object."
def wait():  # by short sleeps: a signal that comes just before one is handled only behind it
    for _ in range(600): time.sleep(0.05)
def verb(args):
    {body}
    return Summary("all is made \\u00b1 1", {{"out": "a"}})
sys.exit(run_verb(Nothing, verb, sys.argv[1:]))
"""


def run(body: str, *words: str, **options) -> subprocess.CompletedProcess[str]:
    """Run a verb of one statement in a process of its own."""
    script = VERB.format(repository=str(REPOSITORY), body=body)
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": ENVIRONMENT} | options
    return subprocess.run([sys.executable, "-c", script, *words], text=True, timeout=60, **options)


def test_full_stdout_is_said_and_what_was_made_is_whole():
    with open("/dev/full", "w") as full:
        done = run("pass", stdout=full)
    assert done.returncode == 2
    assert "standard output" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--help",), "endotwin: standard output cannot be written: is its disk full?"),
        (
            ("export", "--help"),
            "endotwin export: the help cannot be written: is a disk full?",
        ),
    ],
)
def test_help_on_a_full_disk_is_one_line(words, line):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command(*words), cwd=REPOSITORY, stdout=full, stderr=subprocess.PIPE, env=ENVIRONMENT, text=True
        )
    assert (done.returncode, done.stderr) == (2, f"{line}\n")


def test_a_table_or_a_stream_that_cannot_be_written_is_no_success():
    with open("/dev/full", "w") as full:
        done = run("return Summary('made', {}, table='1 2 3')", stdout=full)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
        done = run("from scripts.command import stream_line; stream_line('1')", stdout=full)
    assert done.returncode == 2
    assert done.stderr.endswith(": standard output: No space left on device\n")


def test_closed_streams_are_no_reason_to_fail():
    done = run("open('/dev/null')", preexec_fn=lambda: (os.close(1), os.close(2)), stdout=None, stderr=None)
    assert done.returncode == 0


def test_reader_that_has_gone_is_no_mistake():
    for words in (("--help",), ("generate", "--help"), ("--version",)):
        reading, writing = os.pipe()
        os.close(reading)
        done = subprocess.run(
            command(*words), cwd=REPOSITORY, stdout=writing, stderr=subprocess.PIPE, env=ENVIRONMENT
        )
        os.close(writing)
        assert (done.returncode, done.stderr) == (0, b"")


def test_stdout_without_unicode_shows_what_it_can():
    done = run("pass", env=ENVIRONMENT | {"PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stdout, done.stderr) == (0, "all is made \\xb1 1\n", "")


def test_fault_of_the_program_is_one_line_and_shows_where_it_is_when_asked():
    done = run("{}['key']")
    assert done.returncode == 2
    assert "a fault of the program, please report it: KeyError: 'key'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    done = run("{}['key']", env=ENVIRONMENT | {"ENDOTWIN_TRACEBACK": "1"})
    assert "Traceback" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_cleans_up_and_says_so(number, tmp_path):
    body = (
        "\n    from twin.files.atomic import WholeFile"
        "\n    from pathlib import Path"
        "\n    from scripts.outputs import output_folder"
        f"\n    with WholeFile(output_folder(Path({str(tmp_path)!r}) / 'new') / 'a'):"
        "\n        print('begun', flush=True); wait()"
    )
    script = VERB.format(repository=str(REPOSITORY), body=body)
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert said.endswith(b": stopped\n")
    assert b"Traceback" not in said
    assert list(tmp_path.iterdir()) == []


def test_signal_that_a_callback_swallows_comes_again():
    body = (
        "\n    import os, signal"
        "\n    class Deaf:"
        "\n        def __del__(self): os.kill(os.getpid(), signal.SIGTERM); time.sleep(0.01)"
        "\n    deaf = Deaf(); del deaf; wait()"
    )
    done = run(body)
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr.endswith(": stopped\n")
    assert "Traceback" not in done.stderr


def test_lines_are_printable_and_keep_both_ends():
    assert one_line("a\n  b\x1b[31m") == "a b\\x1b[31m"
    assert one_line("\udcff") == "\\udcff"
    long = one_line(f"file {'x' * 10_000}: the fault")
    assert len(long) == LONGEST_LINE
    assert long.startswith("file x")
    assert long.endswith("x: the fault")


def test_a_signal_waits_for_the_end_of_a_whole_step():
    body = (
        "\n    import os, signal"
        "\n    from scripts.command import UninterruptedStep"
        "\n    with UninterruptedStep():"
        "\n        os.kill(os.getpid(), signal.SIGTERM)"
        "\n        print('whole', flush=True)"
        "\n    print('behind', flush=True)"
    )
    done = run(body)
    assert done.returncode == 143
    assert done.stdout == "whole\n"
    assert "stopped" in done.stderr
