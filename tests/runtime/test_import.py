"""The runtime is light: it brings nothing that a device would not need to run a trained file."""

import subprocess
import sys

import pytest

HEAVY = {
    "dm_control",
    "foxglove",
    "gymnasium",
    "matplotlib",
    "mcap",
    "mujoco",
    "numba",
    "pymoo",
    "scipy.optimize",
    "stable_baselines3",
    "torch",
    "tyro",
}
"""Modules that belong to training, simulation, figures, files and command lines."""
PROGRAM = """
import sys
{code}
print(*[name for name in {heavy!r} if name in sys.modules])
"""


def brought(code: str) -> str:
    """Heavy modules that a fresh Python has after some code."""
    program = PROGRAM.format(code=code, heavy=sorted(HEAVY))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-1000:]
    return done.stdout.strip()


def test_importing_the_runtime_brings_nothing_heavy_and_no_onnx_runtime():
    assert brought("import twin.runtime; assert 'onnxruntime' not in sys.modules") == ""


@pytest.mark.parametrize("module", ["twin.stream", "twin.stream.answers"])
def test_the_live_stream_knows_no_recording_and_no_viewer(module):
    assert brought(f"import {module}") == ""


def test_running_a_trained_file_brings_nothing_heavy(ram_policy):
    code = (
        "from twin.runtime import load_runtime\n"
        f"runtime = load_runtime({str(ram_policy)!r})\n"
        "for k in range(5): runtime.push(0.1 * k, 3.0, 60.0)\n"
    )
    assert brought(code) == ""


def test_a_module_that_is_brought_is_found():
    assert brought("import mcap") == "mcap"
