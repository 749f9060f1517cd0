"""Records of twins that no training meets: what happens to them happens, and to no other."""

import numpy as np
import pytest

from twin.evaluation.scenarios import (
    SAMPLE_TIME,
    TOUCHED,
    WIDER,
    Scenario,
    simulate_pushed,
    untrained_scenarios,
)
from twin.preset import load_preset, load_ranges

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")


@pytest.fixture(scope="module")
def drives():
    return untrained_scenarios(PRESET, RANGES, 10.0, seed=3)


def of_kind(drives, twin):
    return [drive for drive in drives if drive.twin == twin]


def test_a_sheath_moves_by_half_a_turn_within_half_a_second(drives):
    for drive in of_kind(drives, "sheath moves suddenly"):
        moving = np.flatnonzero(np.diff(drive.sheath_bend))
        assert np.ptp(drive.sheath_bend) == pytest.approx(np.pi)
        assert (len(moving) + 1) * SAMPLE_TIME == pytest.approx(0.5, abs=2 * SAMPLE_TIME)


def test_wider_twins_leave_the_ranges_and_keep_to_the_wider_ones(drives):
    wide = RANGES.wider(WIDER).limits
    twins = [drive.preset for drive in of_kind(drives, "wider ranges")]
    values = {name: [getattr(twin, name) for twin in twins] for name, *_ in wide}
    assert all(low <= min(values[name]) and max(values[name]) <= high for name, low, high in wide)
    assert any(min(values[name]) < low or max(values[name]) > high for name, low, high in RANGES.limits)


def test_a_touch_bends_the_tip_while_it_lasts_and_not_before():
    pull = np.full(300, 1e-3)
    time = np.arange(300) * SAMPLE_TIME
    force = 0.1 * ((time >= 2) & (time < 4))
    free, pushed = (
        simulate_pushed(Scenario("tip touched", PRESET, "given", (-1, 1), pull, tip_force=of))
        for of in (np.zeros(300), force)
    )
    away = pushed.truth_deg - free.truth_deg
    assert np.abs(away[:100]).max() < 1e-9
    assert away[150:195].min() > 0.5
    assert TOUCHED[0] < TOUCHED[1]
