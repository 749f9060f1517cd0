"""The frozen test set: its recipe still makes it, and nothing else is taken for it."""

import dataclasses

import numpy as np
import pytest

from twin.evaluation.record import EvaluationRecord
from twin.suite.frozen import TOLERANCE_DEG, drives_sha256, frozen_drives, frozen_file, frozen_name
from twin.suite.scenarios import SAMPLE_TIME, simulate_drives

T = 0.1


@pytest.fixture(scope="module")
def drives():
    return frozen_drives()


def told_records(sample_time=T):
    """Records that have the frozen angles at their times, and lines between them."""
    frozen = frozen_file()
    time = np.arange(0, frozen.seconds, sample_time)
    return [
        EvaluationRecord(
            np.zeros(len(time)),
            np.interp(time, frozen.times_s, bends),
            np.ones(len(time), dtype=bool),
            (-1.0, 1.0),
            "nominal",
            f"record {number}",
        )
        for number, bends in enumerate(frozen.bends_deg)
    ]


def test_the_recipe_has_the_endoscopes_and_commands_that_were_frozen(drives):
    """Whoever changes ranges, presets, commands or random streams gives the set another name."""
    assert drives_sha256(drives) == frozen_file().drives_sha256


@pytest.mark.parametrize("number", [0, 6, 40, 66, 89])
def test_the_twin_has_the_angles_that_were_frozen(drives, number):
    (episode,) = simulate_drives([drives[number]])
    frozen = frozen_file()
    places = np.rint(np.array(frozen.times_s) / SAMPLE_TIME).astype(int)
    np.testing.assert_allclose(
        np.degrees(episode.bend[places]), frozen.bends_deg[number], atol=TOLERANCE_DEG, rtol=0
    )


@pytest.mark.parametrize("sample_time", [0.02, 0.1])
def test_records_are_known_by_their_angles_at_any_sampling(sample_time):
    assert frozen_name(told_records(sample_time), sample_time) == frozen_file().name


def test_a_record_that_is_missing_moved_or_too_short_is_no_frozen_set():
    records = told_records()
    first = records[0]
    assert frozen_name(records[1:], T) is None
    moved = dataclasses.replace(first, bend_deg=first.bend_deg + 2 * TOLERANCE_DEG)
    assert frozen_name([moved, *records[1:]], T) is None
    short = dataclasses.replace(first, bend_deg=first.bend_deg[:100])
    assert frozen_name([short, *records[1:]], T) is None
    assert frozen_name([records[1], first, *records[2:]], T) is None


def test_the_hash_tells_what_is_simulated_and_not_its_last_digits(drives):
    one = drives[0]
    whole = drives_sha256([one])
    assert drives_sha256([dataclasses.replace(one, pull=one.pull * (1 + 1e-15))]) == whole
    assert drives_sha256([dataclasses.replace(one, pull=one.pull * 1.001)]) != whole
    stiffer = one.preset.replace(section_stiffness=one.preset.section_stiffness * 1.001)
    assert drives_sha256([dataclasses.replace(one, preset=stiffer)]) != whole
