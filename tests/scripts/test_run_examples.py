"""The example programs of docs/examples drive a real `endotwin run`, and print its answers."""

import re
import shutil
import subprocess
import sys

import pytest
from repository import ENVIRONMENT, REPOSITORY, command

from twin.live import load_runtime

EXAMPLES = REPOSITORY / "docs/examples"
COMPILER = next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), None)


@pytest.fixture(params=["run_stream.py", "run_stream.c"])
def example(request, tmp_path):
    """The words that start an example."""
    source = EXAMPLES / request.param
    if source.suffix == ".py":
        return [sys.executable, "-I", str(source)]  # -I: whatever it needs, it has from Python alone
    if COMPILER is None:
        pytest.skip("no C compiler here")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    built = tmp_path / "run_stream"
    subprocess.run([COMPILER, *strict, "-o", str(built), str(source), "-lm"], check=True)
    return [str(built)]


def run(example, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*example, *words], capture_output=True, text=True, env=ENVIRONMENT, cwd=REPOSITORY, timeout=120
    )


def test_it_prints_an_estimate_for_each_sample(example, ram_policy):
    done = run(example, *command("run", "--policy", ram_policy))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 100
    assert "100 samples" in done.stderr
    assert "NO_MEASUREMENT 10" in done.stderr
    runtime = load_runtime(ram_policy)
    bends = [float(re.search(r"(-?[\d.]+) deg", line)[1]) for line in lines]
    assert bends[0] == pytest.approx(runtime.push(0.0, 0.0, float("nan")).bend_deg, abs=1e-3)
    assert max(bends) > 20  # it follows the 40 degrees that the example measures


def test_what_the_command_says_and_its_exit_status_come_through(example, tmp_path):
    done = run(example, *command("run", "--policy", tmp_path / "none.onnx"))
    assert done.returncode == 2
    assert done.stdout == ""
    assert "no trained file" in done.stderr.splitlines()[0]
