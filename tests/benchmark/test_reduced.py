"""Measurements of the reduced twin: what they compare, count and refuse to call held."""

import numpy as np
import pytest

from scripts.benchmarks import reduced
from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.simulation import simulate_batch

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")


@pytest.mark.slow
def test_a_twin_that_is_off_does_not_hold(monkeypatch):
    def softer(presets, pulls, sample_time, physics="mujoco", **inputs):
        if physics == "reduced":
            presets = [
                preset.replace(section_stiffness=1.05 * preset.section_stiffness) for preset in presets
            ]
        return simulate_batch(presets, pulls, sample_time, physics=physics, **inputs)

    monkeypatch.setattr(reduced, "simulate_batch", softer)
    monkeypatch.setattr(reduced, "SECONDS", 5.0)
    monkeypatch.setattr(reduced, "SIGNALS", ["sine", "triangle", "multi-sine"])
    results = reduced.agreement(PRESET, RANGES, 3e-3, 1, print)
    assert not results["reduced_rms"].holds
    assert not results["reduced_largest"].holds


def test_a_record_that_is_missing_is_infinitely_far():
    assert np.isinf(reduced._difference(None, None)).all()
