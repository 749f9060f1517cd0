"""Physics and bookkeeping of the reduced twin alone: friction, memory, slack, states, batches, kernels."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.reduced import ReducedTwins, simulate, simulate_batch

T = 0.1
URETEROSCOPE = load_preset("ureteroscope")


def cycle(amplitude: float, period: float, sample_time: float, cycles: int = 2) -> np.ndarray:
    time = np.arange(round(cycles * period / sample_time) + 1) * sample_time
    return amplitude * np.sin(2 * np.pi * time / period)


def test_bend_does_not_depend_on_the_rate():
    preset = URETEROSCOPE.without_viscosity()
    slow, fast = (simulate(preset, cycle(3e-3, period, period / 80), period / 80) for period in (8.0, 80.0))
    np.testing.assert_allclose(slow.bend, fast.bend, atol=1e-9)


def test_steps_give_what_the_record_gives():
    rng = np.random.default_rng(8)
    presets = [load_ranges("vio_com").draw(load_preset("vio_com"), rng) for _ in range(5)]
    pull = cycle(8e-3, 9.0, T)
    twins = ReducedTwins(presets, T)
    stepped = np.array([twins.step(value) for value in pull])
    assert twins.converged.all()
    records = simulate_batch(presets, [pull] * 5, T)
    # The record begins at rest for a second, and its first sample is a step of its own.
    np.testing.assert_allclose(stepped, np.array([record.bend for record in records]).T, atol=2e-3)


def test_wrong_inputs_are_refused_in_one_line():
    twins = ReducedTwins([URETEROSCOPE], T)
    for inputs, message in (
        ({"pull": np.nan}, "must be a finite number"),
        ({"pull": 0.0, "lateral_pull": 1e-3}, "one bending plane"),
        ({"pull": 0.0, "sheath_bend": -1.0}, "not negative"),
    ):
        with pytest.raises(ValueError, match=message):
            twins.step(**inputs)


def test_random_endoscopes_find_their_equilibrium_through_jumps():
    rng = np.random.default_rng(9)
    for name, stroke in (("ureteroscope", 3e-3), ("vio_com", 1e-2)):
        twins = ReducedTwins([load_ranges(name).draw(load_preset(name), rng) for _ in range(100)], T)
        for _ in range(20):
            twins.step(rng.uniform(-stroke, stroke, 100))
        assert twins.converged.all()


def test_interpreted_kernels_give_the_same_to_rounding():
    code = (
        "import numpy as np\n"
        "from twin.preset.file import load_preset\n"
        "from twin.reduced import simulate\n"
        "from twin.mechanics.kernels import COMPILED\n"
        "pull = 2e-3 * np.sin(np.arange(40) / 6)\n"
        "print(COMPILED, *map(float.hex, simulate(load_preset('ureteroscope'), pull, 0.1).bend.tolist()))\n"
    )
    block = "import sys\nsys.modules['numba'] = None\n"
    printed = [
        subprocess.run(
            [sys.executable, "-c", text],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
        ).stdout.split()
        for text, disabled in ((code, "0"), (block + code, "0"), (code, "1"))
    ]
    assert [words[0] for words in printed] == ["True", "False", "False"]
    compiled, *interpreted = (np.array([float.fromhex(word) for word in words[1:]]) for words in printed)
    np.testing.assert_allclose(interpreted, [compiled] * 2, atol=1e-9)


def test_it_imports_no_mujoco():
    code = "import sys, twin.reduced; sys.exit('mujoco' in sys.modules or 'dm_control' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path("/")).returncode == 0


def test_stepping_keeps_no_memory():
    """Arrays that kernels make within a sample are given back: a controller runs for days."""
    twins = ReducedTwins([URETEROSCOPE.replace(servo_gain=8.0)] * 2, T)
    peaks = []
    for _ in range(4):
        for value in cycle(2e-3, 5.0, T):
            twins.step(value)
            twins.inverse(0.3, stroke=(-3e-3, 3e-3))
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert peaks[3] <= peaks[0] + 256  # [KiB]: one work array kept each time would be more
