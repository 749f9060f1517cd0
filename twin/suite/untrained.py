"""Test records of twins that no training meets: what happens to endoscopes, and other endoscopes.

On the commands of the full suite, on its narrowest and its widest stroke:

- the preset, for sensors that have a fault (`twin/signals/sensor_faults.py`);
- its sheath moves by half a turn within half a second;
- something touches its tip, and lets go again;
- twins drawn from ranges half as wide again;
- another endoscope: each of the other presets, pulled as far as a longer one needs.
"""

import numpy as np

from twin.preset import Preset, Ranges, load_preset, preset_names
from twin.signals.excitation import SIGNALS
from twin.signals.streams import SeedUse, random_stream
from twin.suite.scenarios import BENDING, SAMPLE_TIME, STROKES_MM, Scenario, commands

STROKES = (STROKES_MM[0], STROKES_MM[2])
WIDER = 1.5
"""Times that the ranges are widened."""
WIDE = 10
"""Twins drawn from them."""
MOVES_AT, MOVES_FOR_S = 0.4, 0.5
"""Share of a record after which the sheath moves, and for how long [s]."""
TOUCHED, TOUCH_N = (0.3, 0.7), 0.1
"""Shares of a record between which the tip is touched, and the force [N]."""
FARTHER = 2.5
"""Times that the widest stroke is widened for another endoscope: `vio_com` does not bend below some mm."""


def untrained_scenarios(preset: Preset, ranges: Ranges, seconds: float, seed: int) -> list[Scenario]:
    """Return the drives, stroke by stroke; arguments as of `scenarios`."""
    wide = ranges.wider(WIDER)
    twins = [wide.draw(preset, random_stream(seed, SeedUse.BENCHMARK_WIDE_TWINS, k)) for k in range(WIDE)]
    others = [load_preset(name) for name in preset_names() if name != preset.name]
    drives = []
    for stroke in STROKES:
        for place, (signal, pull) in enumerate(commands(stroke, seconds, seed).items()):
            time = np.arange(len(pull)) * SAMPLE_TIME
            moved = np.interp(time, np.array([0, MOVES_FOR_S]) + MOVES_AT * seconds, BENDING)
            touched = TOUCH_N * ((time >= TOUCHED[0] * seconds) & (time < TOUCHED[1] * seconds))
            drives += [
                Scenario("nominal", preset, signal, stroke, pull),
                Scenario("sheath moves suddenly", preset, signal, stroke, pull, moved),
                Scenario("tip touched", preset, signal, stroke, pull, tip_force=touched.astype(float)),
                *(
                    Scenario("wider ranges", twin, signal, stroke, pull)
                    for twin in twins[place :: len(SIGNALS)]
                ),
            ]
    low, high = STROKES_MM[2]
    farther = (FARTHER * low, FARTHER * high)
    for other in others:
        drives += [
            Scenario("another endoscope", other, signal, farther, FARTHER * pull)
            for signal, pull in commands(STROKES_MM[2], seconds, seed).items()
        ]
    return drives
