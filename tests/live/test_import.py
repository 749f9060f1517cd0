"""The live path is light: it imports nothing that a device would not need to run a trained file."""

import subprocess
import sys

import pytest

HEAVY = {
    *("dm_control", "gymnasium", "matplotlib", "mcap", "mujoco", "numba", "pymoo", "websockets"),
    *("scipy.optimize", "stable_baselines3", "torch", "tyro"),
}
"""Modules of training, simulation, figures, files and command lines."""
RUN = """from twin.live import load_runtime
runtime = load_runtime({path!r})
for k in range(5): runtime.push(0.1 * k, 3.0, 60.0)"""


def imported(code: str) -> str:
    """Heavy modules that a fresh Python has after some code."""
    code += f"\nimport sys; print(*[name for name in {sorted(HEAVY)} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-1000:]
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("import sys, twin.live; assert 'onnxruntime' not in sys.modules", ""),
        ("import twin.live.lines", ""),
        (RUN, ""),
        ("import mcap", "mcap"),
    ],
)
def test_nothing_heavy_is_imported(code, heavy, ram_policy):
    assert imported(code.format(path=str(ram_policy))) == heavy
