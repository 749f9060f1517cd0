"""Measurements of the reduced twin: what they compare, count and refuse to call held."""

import numpy as np

from twin.benchmark import reduced
from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.simulation import simulate_batch

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")


def nothing(*_: object) -> None:
    """Progress that nobody watches."""


def test_agreement_is_measured_on_every_signal_and_draw(monkeypatch):
    monkeypatch.setattr(reduced, "SECONDS", 5.0)
    told = []
    results = reduced.agreement(PRESET, RANGES, 3e-3, 2, lambda *counts: told.append(counts))
    assert list(results) == ["reduced_rms", "reduced_largest", "reduced_start", "reduced_tension"]
    assert (
        "worst of 9 records" in results["reduced_rms"].name
    )  # 5 signals, 2 draws, moving sheath, two planes
    assert told[-1] == (7, 7)
    assert all(result.holds for result in results.values())
    assert results["reduced_rms"].value > results["reduced_rms"].peer_value > 0


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
    results = reduced.agreement(PRESET, RANGES, 3e-3, 1, nothing)
    assert not results["reduced_rms"].holds
    assert not results["reduced_largest"].holds


def test_draws_without_equilibrium_are_counted(monkeypatch):
    assert reduced.draws(PRESET, RANGES, 3e-3, 6, nothing).value == 0
    monkeypatch.setattr(reduced, "simulate_batch", lambda presets, *_, **__: [None, *presets[1:]])
    result = reduced.draws(PRESET, RANGES, 3e-3, 6, nothing)
    assert (result.value, result.holds) == (1, False)


def test_inverse_is_measured_by_where_it_brings_the_bend(monkeypatch):
    monkeypatch.setattr(reduced, "INVERSE_BENDS", 80)
    results = reduced.inverse(PRESET, RANGES, 4e-3)
    assert 0 < results["reduced_inverse"].value <= 0.01 * (1 + 1e-9)
    assert results["reduced_inverse"].holds


def test_members_are_timed_by_the_sample(monkeypatch):
    monkeypatch.setattr(reduced, "ONLINE_SAMPLES", 20)
    assert 1e-3 < reduced.online(PRESET, RANGES, 3e-3).value < 1e3


def test_a_record_that_is_missing_is_infinitely_far():
    assert np.isinf(reduced._difference(None, None)).all()


def test_a_start_is_timed_in_a_process_of_its_own():
    result = reduced.start(PRESET)
    assert 0.05 < result.value < 60  # [s]
    assert result.holds == (result.value < 0.5)
