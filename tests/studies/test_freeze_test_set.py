"""The published test set: its recipe still makes it, and no other records are recognised as it."""

import dataclasses

import numpy as np
import pytest
from scores import simulated_record

from scripts.studies.freeze_test_set import drives_sha256, frozen_drives
from twin.evaluation import scenarios
from twin.evaluation.scenarios import SAMPLE_TIME, TOLERANCE_DEG, name_of_test_set, simulate_drives

T = 0.1
FINGERPRINT = scenarios.test_set_fingerprint()


@pytest.fixture(scope="module")
def drives():
    return frozen_drives()


def known_records(sample_time=T):
    """Records that have the published angles at their times, and lines between them."""
    time = np.arange(0, FINGERPRINT.seconds, sample_time)
    return [
        simulated_record(np.zeros(len(time)), np.interp(time, FINGERPRINT.times_s, bends), T=sample_time)
        for bends in FINGERPRINT.bends_deg
    ]


def test_the_recipe_has_the_endoscopes_and_commands_that_were_frozen(drives):
    assert drives_sha256(drives) == FINGERPRINT.drives_sha256


@pytest.mark.parametrize("number", [0, 6, 40, 66, 89])
def test_the_twin_has_the_angles_that_were_frozen(drives, number):
    (episode,) = simulate_drives([drives[number]])
    places = np.rint(np.array(FINGERPRINT.times_s) / SAMPLE_TIME).astype(int)
    np.testing.assert_allclose(
        np.degrees(episode.bend[places]), FINGERPRINT.bends_deg[number], atol=TOLERANCE_DEG, rtol=0
    )


@pytest.mark.parametrize("sample_time", [0.02, 0.1])
def test_records_are_known_by_their_angles_at_any_sampling(sample_time):
    assert name_of_test_set(known_records(sample_time), sample_time) == FINGERPRINT.name


def test_a_record_that_is_missing_moved_or_too_short_is_no_frozen_set():
    records = known_records()
    first = records[0]
    assert name_of_test_set(records[1:], T) is None
    moved = dataclasses.replace(first, truth_deg=first.truth_deg + 2 * TOLERANCE_DEG)
    assert name_of_test_set([moved, *records[1:]], T) is None
    short = first.part(0, 100)
    assert name_of_test_set([short, *records[1:]], T) is None
    assert name_of_test_set([records[1], first, *records[2:]], T) is None


def test_the_hash_tells_what_is_simulated_and_not_its_last_digits(drives):
    one = drives[0]
    whole = drives_sha256([one])
    assert drives_sha256([dataclasses.replace(one, pull=one.pull * (1 + 1e-15))]) == whole
    assert drives_sha256([dataclasses.replace(one, pull=one.pull * 1.001)]) != whole
    stiffer = one.preset.replace(section_stiffness=one.preset.section_stiffness * 1.001)
    assert drives_sha256([dataclasses.replace(one, preset=stiffer)]) != whole
