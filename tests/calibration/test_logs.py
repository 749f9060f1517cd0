"""Logs on an even grid: one without a loop, or that one plane cannot follow, is refused; windows."""

import dataclasses

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, recorded

from twin.calibration import measured_loop
from twin.calibration.files import read_loops
from twin.calibration.logs import thinned
from twin.episode import Episode
from twin.recording import write_episode


def test_grid_keeps_the_loop_and_a_phase_gets_a_pace():
    episode = recorded()
    slow = measured_loop(episode, "slow", SAMPLE_TIME, pace=0.5)
    assert len(slow.episode.pull) == pytest.approx(2 * len(episode.time), abs=2)
    np.testing.assert_allclose(slow.episode.pull[::2][:50], episode.pull[:50], atol=1e-9)
    phased = Episode(**(vars(episode) | {"metadata": {"seconds_per_cycle": 4.0}}))
    assert len(measured_loop(phased, "phases", SAMPLE_TIME).seen) == len(slow.episode.pull)
    half = measured_loop(episode, "half", SAMPLE_TIME, fraction=0.5)
    assert half.fitted.sum() == pytest.approx(len(half.seen) / 2, abs=1)
    assert half.fitted[0]
    assert not half.fitted[-1]


@pytest.mark.parametrize(
    ("pull", "rule"),
    [
        (np.zeros(50), "nothing to calibrate on"),
        (np.linspace(0, 3e-3, 50), "never reverses"),
        (np.linspace(3e-3, -3e-3, 50), "never reverses"),
    ],
)
def test_log_without_a_loop_is_refused(pull, rule):
    episode = recorded()
    log = {name: getattr(episode, name)[:50] for name in ("time", "bend", "measured_bend", "joint_angle")}
    log |= {"wire_tension": episode.wire_tension[:50], "sheath_friction": episode.sheath_friction[:50]}
    with pytest.raises(ValueError, match=f"a log: .*{rule}") as refused:
        measured_loop(Episode(pull=pull, **log), "a log", SAMPLE_TIME)
    assert "\n" not in str(refused.value)


def test_log_that_one_plane_in_a_sheath_at_rest_cannot_follow_is_refused():
    episode = recorded()
    count = len(episode.time)
    for changes, rule in (
        ({"sheath_bend": np.linspace(0, 1, count)}, "the sheath's bend changes"),
        ({"lateral_pull": np.linspace(0, 1e-3, count)}, "the angle in their plane was not measured"),
        ({"measured_bend": -episode.measured_bend}, "import it with `reverse_angle`"),
        ({"wire_tension": np.full((count, 2, 1), 5.0)}, "the tensions do not change"),
        ({"wire_tension": np.full((count, 2, 1), 1e200)}, r"tension of 1e\+200 N: must be within 1e\+06"),
        ({"measured_bend": episode.measured_bend * 1e9}, "angle of .* rad: must be within 100"),
        ({"measured_bend": np.full(count, 0.3)}, "the angle does not change"),
    ):
        with pytest.raises(ValueError, match=f"odd: .*{rule}"):
            measured_loop(dataclasses.replace(episode, **changes), "odd", SAMPLE_TIME)
    for sample_time, options, rule in (
        (SAMPLE_TIME, {"fraction": 0.01}, r"odd: . measured samples of 0\.05 s to fit.*: needs at least 10"),
        (SAMPLE_TIME, {"pace": 1e6}, r"odd: .* at the pace of 1e\+06: shorter than a sample"),
        (0.0, {}, "sample time 0 s: must be positive"),
        (1e-9, {}, "would be more than 10000000 samples"),
    ):
        with pytest.raises(ValueError, match=rule):
            measured_loop(episode, "odd", sample_time, **options)


def test_missing_samples_are_not_fitted():
    time = np.arange(0, 20, 0.05)
    pull = 2e-3 * np.sin(2 * np.pi * time / 10)
    bend = 300 * pull + 0.05 * np.sign(np.cos(2 * np.pi * time / 10))
    seen = bend.copy()
    seen[100:140] = np.nan
    holed = Episode(
        time=time,
        pull=pull,
        bend=bend,
        measured_bend=seen,
        joint_angle=np.empty((len(time), 0)),
        wire_tension=np.empty((len(time), 2, 0)),
        sheath_friction=np.empty((len(time), 2, 0)),
    )
    loop = measured_loop(holed, "holed", 0.05)
    assert not loop.fitted[101:139].any()
    assert loop.fitted[:100].all()
    assert np.isfinite(loop.episode.bend).all()
    nearly = dataclasses.replace(holed, measured_bend=np.where(np.arange(len(time)) < 9, bend, np.nan))
    with pytest.raises(ValueError, match=r"holed: 9 measured samples .*: needs at least 10"):
        measured_loop(nearly, "holed", 0.05)


def lasting(seconds, interval):
    """Return a log of so many seconds, a sample each interval [s]."""
    count = round(seconds / interval) + 1
    still = np.zeros(count)
    nothing = np.zeros((count, 2, 0))
    return Episode(np.arange(count) * interval, still, still, still, np.zeros((count, 1)), nothing, nothing)


def test_logs_are_thinned_to_a_usual_number_of_samples():
    ten = lasting(10, 0.05)
    assert thinned([ten], TRUTH) == pytest.approx(0.01)
    assert thinned([lasting(30, 0.05)], TRUTH) == pytest.approx(0.03)
    assert thinned([ten] * 3, TRUTH) == pytest.approx(0.03)
    assert thinned([lasting(1000, 0.05)], TRUTH) == pytest.approx(0.1)
    assert thinned([ten] * 3, TRUTH, pace=3.0) == pytest.approx(0.01)


def test_seldom_logs_are_compared_a_few_times_as_often_as_they_were_taken():
    poses = lasting(60, 1.0)
    assert thinned([poses], TRUTH) == pytest.approx(0.25)
    assert thinned([poses], TRUTH, pace=2.0) == pytest.approx(0.12)
    assert thinned([poses, lasting(60, 0.1)], TRUTH) == pytest.approx(0.1)
    assert thinned([poses], TRUTH, predicted=[lasting(60, 0.1)]) == pytest.approx(0.07)
    assert thinned([lasting(12, 1.0)], TRUTH) == pytest.approx(0.25)
    forty = thinned([lasting(9, 1.0)], TRUTH)  # as a part of them may be fitted
    assert forty == pytest.approx(0.22)


TURNS = recorded().pull[:40]  # there and back
RISES = np.linspace(-2e-3, 2e-3, 40)


def window_of(folder, place, pull, sign=1.0, file="a"):
    episode = recorded()
    part = {
        name: values[:40]
        for name, values in vars(episode).items()
        if isinstance(values, np.ndarray) and len(values)
    }
    facts = {"source": "measured", "window": place, "file_sha256": file, "name": f"{file}_{place}"}
    bend = sign * (60 * pull + 1e-3 * np.arange(40))
    part |= {"pull": pull, "bend": bend, "measured_bend": bend, "wire_tension": np.empty((40, 2, 0))}
    write_episode(folder / f"{file}_{place}.mcap", dataclasses.replace(episode, metadata=facts, **part))


def names(loops):
    return [loop.name for loop in loops]


def test_the_share_is_one_of_the_windows_of_each_file(tmp_path):
    for place in range(4):
        window_of(tmp_path, place, TURNS)
    window_of(tmp_path, 0, TURNS, file="b")
    fitted, predicted, _ = read_loops([tmp_path], [], TRUTH, fraction=0.5)
    assert names(fitted) == ["a_0", "a_1", "b_0"]  # at least one of each
    assert names(predicted) == ["a_2", "a_3"]
    assert all(loop.fitted.all() for loop in fitted)
    assert not any(loop.fitted.any() for loop in predicted)
    assert names(read_loops([tmp_path], [], TRUTH)[0]) == ["a_0", "a_1", "a_2", "a_3", "b_0"]
    with pytest.raises(ValueError, match="fraction = 0: must be above 0 and at most 1"):
        read_loops([tmp_path], [], TRUTH, fraction=0)


def test_a_window_may_stand_still_or_go_one_way_where_another_reverses(tmp_path):
    for place, pull in enumerate((np.zeros(40), RISES, TURNS)):
        window_of(tmp_path, place, pull)
    assert len(read_loops([tmp_path], [], TRUTH)[0]) == 3
    with pytest.raises(ValueError, match="a_0: the command moves by 0 mm: nothing to calibrate on"):
        read_loops([tmp_path], [], TRUTH, fraction=0.6)
