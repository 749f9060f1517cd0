"""Any command killed at any moment, or on a disk that fills up: the same command then ends in the same bytes.

`make endurance` kills three hundred times. One of those alone: HOSTILE_SEED=7, `-k 300 -m endurance`.
"""

import re
import signal
import subprocess
import sys
import time
from collections import Counter

import disturbed
import pytest
from built_workbench import one_place
from repository import ENVIRONMENT
from workbench import COMMANDS

KILLED = [command for command in COMMANDS if command.kill]
DISTURBANCES = {"kills": disturbed.faults_of_a_kill, "full disks": disturbed.faults_of_a_full_disk}
FEW = 6
"""Kills of the normal run, of commands that end soon."""


def few_and_many(few: int, many: int) -> list:
    return [few, pytest.param(many, marks=pytest.mark.endurance)]


def disturb_all(kind: str, count: int, workbench, runner) -> None:
    wholes: dict[str, disturbed.Undisturbed] = {}
    counts, faults = Counter(), []
    commands = [command for command in KILLED if count > FEW or not command.slow]
    for seed in disturbed.repeat_count(count):
        # An offset, so that each signal meets each command.
        command = commands[(seed + seed // 3) % len(commands)]
        if command.name not in wholes:
            wholes[command.name] = disturbed.undisturbed(command, workbench, runner)
        found = DISTURBANCES[kind](command, wholes[command.name], seed, workbench, runner)
        counts[command.verb, "fault" if found else "fine"] += 1
        faults += [f"HOSTILE_SEED={seed} of {count}, {command.name}: {fault}" for fault in found]
    unstable = {name: sorted(whole.unstable) for name, whole in wholes.items() if whole.unstable}
    print(f"{count} {kind}: {dict(counts)}; not compared: {unstable}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("count", few_and_many(FEW, 300))
def test_killed_command_ends_in_the_same_bytes_when_it_runs_again(workbench, runner, count):
    disturb_all("kills", count, workbench, runner)


@pytest.mark.parametrize("count", few_and_many(3, 60))
def test_full_disk_is_one_line_and_the_same_command_goes_on(workbench, runner, count):
    disturb_all("full disks", count, workbench, runner)


@pytest.mark.parametrize("count", few_and_many(2, 30))
def test_interrupt_in_the_first_second_is_no_traceback(workbench, count):
    """Of the real command: what is interrupted there is an import."""
    for k in range(count):
        with one_place(workbench.root) as place:
            words = [sys.executable, "-m", "twin", "import", "log.csv", "--out", "made"]
            running = subprocess.Popen(
                words,
                cwd=place.work,
                env=ENVIRONMENT,
                stderr=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                text=True,
            )
            time.sleep(0.3 + 1.5 * k / count)
            running.send_signal(signal.SIGINT)
            _, said = running.communicate(timeout=60)
            # Until the package is imported and its `main` runs, Python itself has the say.
            ours = re.findall(r'File "[^"]*/((?:twin|rl|scripts)/[^"]*)", line (\d+)', said)
            ours = [place for place in ours if place[0] != "twin/__init__.py"]
            assert not ours, f"after {0.3 + 1.5 * k / count:.2f} s: traceback in {ours[-1]}"
            assert running.returncode in (0, 130, -signal.SIGINT)
