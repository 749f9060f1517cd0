import numpy as np
import pytest

from twin.evaluation.scenarios import RANDOMIZED, STROKES_MM, commands, members, scenarios, write_scenarios
from twin.preset.file import load_preset
from twin.preset.randomization import load_ranges
from twin.recording import read_dataset
from twin.signals.excitation import SIGNALS

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")


@pytest.fixture(scope="module")
def drives():
    return scenarios(PRESET, RANGES, 4.0, seed=3)


def test_every_stroke_has_the_preset_a_bending_sheath_and_all_randomised_twins(drives):
    for stroke in STROKES_MM:
        mine = [drive for drive in drives if drive.stroke_mm == stroke]
        kinds = [drive.twin for drive in mine]
        assert (kinds.count("nominal"), kinds.count("bending sheath")) == (len(SIGNALS), len(SIGNALS))
        assert len({drive.preset for drive in mine if drive.twin == "randomized"}) == RANDOMIZED
        assert {drive.signal for drive in mine} == set(SIGNALS)


def test_twins_of_a_stroke_follow_five_commands_within_it(drives):
    for stroke in STROKES_MM:
        pulls = {drive.pull.tobytes(): drive.pull for drive in drives if drive.stroke_mm == stroke}
        assert len(pulls) == len(SIGNALS)
        for pull in pulls.values():
            assert (pull >= stroke[0] * 1e-3 - 1e-12).all()
            assert (pull <= stroke[1] * 1e-3 + 1e-12).all()


def test_no_member_of_an_ensemble_is_a_twin_of_the_test(drives):
    pull = commands((-1.0, 1.0), 4.0, 3)["sine"]
    ensemble = members(PRESET, RANGES, pull, 64, seed=3)
    tested = {drive.preset for drive in drives}
    assert not tested & {member.preset for member in ensemble}
    assert sum(member.sheath_bend is not None for member in ensemble) == 32
    low, high = dict((name, (low, high)) for name, low, high in RANGES.limits)["sheath_bend"]
    for member in ensemble:
        bend = member.preset.sheath_bend if member.sheath_bend is None else member.sheath_bend
        assert np.min(bend) >= low
        assert np.max(bend) <= high


@pytest.mark.slow
def test_records_are_written_once_with_what_they_are(tmp_path):
    paths = write_scenarios(tmp_path, PRESET, RANGES, 0.5, seed=0)
    first = paths[0].stat().st_mtime_ns
    assert write_scenarios(tmp_path, PRESET, RANGES, 0.5, seed=0) == paths
    assert paths[0].stat().st_mtime_ns == first
    episodes = read_dataset(tmp_path)
    assert [episode.metadata["twin"] for episode in episodes[:3]] == [
        "nominal",
        "bending sheath",
        "randomized",
    ]
    assert episodes[0].metadata["stroke_mm"] == [-1.0, 1.0]
    assert np.ptp(episodes[1].sheath_bend) == pytest.approx(np.pi)
    with pytest.raises(ValueError, match="records of another benchmark"):
        write_scenarios(tmp_path, PRESET, RANGES, 0.5, seed=1)
