"""The example programs of docs/examples drive a real `endotwin run`, and print its answers."""

import re
import shutil
import subprocess
import sys

import pytest
from repository import ENVIRONMENT, REPOSITORY, command

from twin.live import load_runtime

EXAMPLES = REPOSITORY / "docs/examples"
COMPILERS = {".c": ("cc", "gcc", "clang"), ".hpp": ("c++", "g++", "clang++")}
CPP = r"""
#include "endotwin.hpp"

int main(int count, char **words) {
    endotwin::Estimator estimator(std::vector<std::string>(words + 1, words + count));
    try {
        for (int k = 0; k < 100; k++) {
            const double time_s = 0.1 * k, measured = 40 * std::sin(time_s - 0.3);
            const auto reading = estimator.push(time_s, 2 * std::sin(time_s), k % 10 == 9 ? NAN : measured);
            if (k > 0 && !(reading.low_deg <= reading.bend_deg && reading.bend_deg <= reading.high_deg))
                return 3;
            std::printf("%.3f deg %d\n", reading.bend_deg, reading.trusted);
        }
        estimator.push(NAN, 0, 0);
    } catch (const std::runtime_error &error) {
        std::fprintf(stderr, "%s\n", error.what());
    }
    return estimator.close();
}
"""
"""A program that uses the header as `run_stream.c` uses the command."""


@pytest.fixture(params=["run_stream.py", "run_stream.c", "endotwin.hpp"])
def example(request, tmp_path):
    """The words that start an example."""
    source = EXAMPLES / request.param
    if source.suffix == ".py":
        return [sys.executable, "-I", str(source)]  # -I: whatever it needs, it has from Python alone
    compiler = next(filter(shutil.which, COMPILERS[source.suffix]), None)
    if compiler is None:
        pytest.skip(f"no compiler for {source.name} here")
    standard = "-std=c99"
    if source.suffix == ".hpp":
        (tmp_path / "main.cpp").write_text(CPP)
        source, standard = tmp_path / "main.cpp", "-std=c++11"
    strict = [standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{EXAMPLES}"]
    built = tmp_path / "run_stream"
    subprocess.run([compiler, *strict, "-o", str(built), str(source), "-lm"], check=True)
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
