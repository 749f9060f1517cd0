"""Sessions of the viewer: a driven twin follows its inputs as an endoscope can, a recording is played."""

import math

import numpy as np
import pytest

from twin.live.reading import Alarm, Health, Reading, Source, StreamSample
from twin.preset import load_preset
from twin.recording import read_episode
from twin.recording.live import LiveRecording
from twin.view import Columns, Inputs, LiveTwin, Playback

PRESET = load_preset("ureteroscope")
REST = Inputs(sheath_bend_deg=math.degrees(PRESET.sheath_bend))


def drive(twin: LiveTwin, seconds: float, wanted: Inputs) -> np.ndarray:
    """Advance in updates of a thirtieth of a second; the last sample."""
    for _ in range(round(30 * seconds)):
        twin.advance(1 / 30, wanted)
    return twin.trail()[-1]


@pytest.fixture(scope="module")
def twin():
    return LiveTwin(PRESET)


@pytest.fixture(autouse=True)
def at_rest(twin):
    twin.reset()


def test_a_pull_follows_its_slider_at_a_speed_and_bends_the_section(twin):
    half = drive(twin, 0.25, REST._replace(pull_mm=2.0))
    assert half[Columns.PULL_MM] == pytest.approx(1.0, abs=0.1)  # 4 mm/s
    now = drive(twin, 1.0, REST._replace(pull_mm=2.0))
    assert now[Columns.PULL_MM] == pytest.approx(2.0)
    assert now[Columns.BEND_DEG] == pytest.approx(np.degrees(twin.pose().joint_angle.sum()))
    assert now[Columns.BEND_DEG] > 20
    pulley_a, pulley_b, tip_a, _ = now[Columns.TENSIONS_N :]
    assert pulley_a > tip_a > 0  # friction of the sheath
    assert pulley_a > pulley_b


def test_pushing_the_tip_bends_it_while_the_pull_stays(twin):
    before = drive(twin, 0.5, REST)
    pushed = drive(twin, 1.0, REST._replace(tip_force_n=0.8))
    assert pushed[Columns.PULL_MM] == before[Columns.PULL_MM] == 0.0
    assert pushed[Columns.BEND_DEG] > before[Columns.BEND_DEG] + 5
    assert twin.pose().tip_force_n == pytest.approx(0.8)


def bend_at_one_mm(twin: LiveTwin, wanted: Inputs) -> float:
    twin.reset()
    drive(twin, 2.0, wanted)
    return float(drive(twin, 1.0, wanted._replace(pull_mm=1.0))[Columns.BEND_DEG])


def test_friction_and_bend_of_the_sheath_lose_motion(twin):
    easy = bend_at_one_mm(twin, REST._replace(friction=0.0))
    hard = bend_at_one_mm(twin, REST._replace(friction=2.0))
    straight = bend_at_one_mm(twin, REST._replace(sheath_bend_deg=0.0))
    curled = bend_at_one_mm(twin, REST._replace(sheath_bend_deg=360.0))
    assert easy > hard + 2
    assert straight > curled + 2
    assert twin.pose().sheath_bend == pytest.approx(2 * math.pi)


def test_a_slow_machine_shows_slow_motion(twin):
    twin.advance(5.0, REST)
    assert twin.time_s == pytest.approx(0.1)


def test_a_reset_returns_to_the_first_moment(twin):
    first = twin.trail().copy()
    drive(twin, 1.0, REST._replace(pull_mm=2.0, friction=3.0, tip_force_n=0.5))
    twin.reset()
    np.testing.assert_array_equal(twin.trail(), first)
    assert twin.inputs == REST


def test_a_minute_of_samples_is_kept(twin, monkeypatch):
    monkeypatch.setattr("twin.view.session.TRAIL", 20)
    drive(twin, 1.0, REST)
    assert len(twin.trail()) == 20
    assert (np.diff(twin.trail()[:, Columns.TIME_S]) > 0).all()


def test_two_planes_are_pulled_each_by_its_own_slider():
    twin = LiveTwin(PRESET.replace(bending_planes=2))
    now = drive(twin, 1.0, REST._replace(lateral_pull_mm=2.0))
    assert now[Columns.LATERAL_BEND_DEG] > 10 > abs(now[Columns.BEND_DEG])
    assert len(now) == Columns.TENSIONS_N + 2 * 4
    assert len(twin.pose().lateral_joint_angle) == PRESET.vertebrae


def test_a_pull_counts_from_where_the_command_is_neutral():
    twin = LiveTwin(PRESET.replace(command_zero=2e-3))
    assert abs(drive(twin, 1.0, REST)[Columns.BEND_DEG]) < 1


def test_a_policy_reads_a_noisy_sensor_at_its_own_sample_time(ram_policy):
    twins = [LiveTwin(PRESET, ram_policy, seed) for seed in (1, 1, 2)]
    trails = []
    for twin in twins:
        drive(twin, 2.0, REST._replace(pull_mm=1.0))
        trails.append(twin.trail()[1:])
    measured, estimate = trails[0][:, Columns.MEASURED_DEG], trails[0][:, Columns.ESTIMATE_DEG]
    assert 10 <= len(np.unique(measured)) <= 25  # 2 s at 0.1 s
    assert np.isfinite(estimate).all()
    assert np.std(measured - trails[0][:, Columns.BEND_DEG]) > 0.1
    np.testing.assert_array_equal(trails[0], trails[1])
    assert (trails[0][:, Columns.MEASURED_DEG] != trails[2][:, Columns.MEASURED_DEG]).any()
    assert twins[0].method == "RAM"


@pytest.fixture(scope="module")
def recording(whole_dataset):
    return sorted(whole_dataset.glob("*.mcap"))[0]


def test_a_recording_is_played_sample_by_sample(recording):
    playback, episode = Playback(recording), read_episode(recording)
    assert playback.last_s == pytest.approx(episode.time[-1] - episode.time[0])
    for index in (0, 7, len(episode.time) - 1):
        playback.time_s = float(episode.time[index] - episode.time[0])
        now = playback.trail()[-1]
        assert len(playback.trail()) == index + 1
        assert now[Columns.BEND_DEG] == pytest.approx(np.degrees(episode.bend[index]))
        assert now[Columns.PULL_MM] == pytest.approx(episode.pull_mm[index])
        np.testing.assert_array_equal(playback.pose().joint_angle, episode.joint_angle[index])
        tensions = episode.wire_tension[index][:, [0, -1]].T.ravel()
        np.testing.assert_array_equal(now[Columns.TENSIONS_N :], tensions)
    assert playback.method == ""
    assert playback.preset.section_length == PRESET.section_length


def test_a_run_is_played_with_its_estimate_and_interval(tmp_path):
    reading = Reading(5.0, 3.0, 8.0, Source.ADVANCED, Health.GOOD, Alarm.NONE)
    with LiveRecording(tmp_path / "run.mcap", "RAM (twins)") as recorded:
        for k in range(5):
            known = reading._replace(bend_deg=5.0 + k)
            of = known if k < 4 else known._replace(low_deg=-171.0, high_deg=189.0)
            recorded.add(StreamSample(0.1 * k, 0.2, 4.0, of))
    playback = Playback(tmp_path / "run.mcap")
    playback.time_s = playback.last_s
    columns = [Columns.ESTIMATE_DEG, Columns.LOW_DEG, Columns.HIGH_DEG]
    assert playback.method == "RAM twins"
    np.testing.assert_array_equal(playback.trail()[3, columns], [8.0, 3.0, 8.0])
    assert np.isnan(playback.trail()[4, columns[1:]]).all()
    assert playback.trail().shape[1] == Columns.TENSIONS_N  # none was measured
