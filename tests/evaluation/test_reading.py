"""What identification, training and evaluation are given of a log with holes."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import make_episode

from twin.episode import Episode
from twin.evaluation.reading import complete_pieces, evaluation_records, true_records
from twin.measured.folder import write_measured
from twin.measured.log import LogFormat, read_measured_log
from twin.recording import write_episode

SAMPLE_TIME = 0.1


def imported(folder, angle, time=None, name="log"):
    """A log of half a sine per second, its angles as text, gone all the way to an MCAP file."""
    time = np.arange(len(angle)) * SAMPLE_TIME if time is None else np.asarray(time)
    rows = zip(time.tolist(), np.sin(np.pi * time).tolist(), angle, strict=True)
    csv = folder / f"{name}.csv"
    csv.write_text("time_s,pull_mm,angle_deg\n" + "".join(f"{t!r},{p!r},{a}\n" for t, p, a in rows))
    form = LogFormat(command_column="pull_mm")
    (folder / name).mkdir(exist_ok=True)
    return write_measured(folder / name, name, read_measured_log(csv, form))


def test_a_sample_that_was_not_measured_is_neither_measured_nor_scored(tmp_path):
    path = imported(tmp_path, ["", "nan", 2, 3, "", 5, 6, 7])
    (record,) = evaluation_records([path], SAMPLE_TIME)
    np.testing.assert_array_equal(record.known, [True, True, False, True, True, True])
    np.testing.assert_allclose(record.filled_deg, [2, 3, 4, 5, 6, 7], atol=1e-9)
    np.testing.assert_allclose(record.pull_mm, np.sin(np.pi * np.arange(2, 8) / 10), atol=1e-9)
    assert (record.source, record.name) == ("measured", "log")
    assert record.stroke_mm == (0.6, 1.0)


def test_a_simulated_record_is_known_throughout(tmp_path):
    episode = make_episode(samples=30)
    holes = np.where(np.arange(30) % 3 == 0, np.nan, episode.measured_bend)
    facts = {"episode": 7, "stroke_mm": [2.0, 4.0]}
    path = write_episode(
        tmp_path / "a.mcap",
        dataclasses.replace(episode, measured_bend=holes, metadata=episode.metadata | facts),
    )
    (record,) = evaluation_records([path], 0.04)
    assert record.known.all()
    np.testing.assert_allclose(record.filled_deg, episode.truth_deg[::2])
    assert (record.stroke_mm, record.source, record.name) == ((2.0, 4.0), "Öse", "episode_0007")


def simple(pull_mm, measured):
    count = len(pull_mm)
    return Episode(
        time=np.arange(count) * SAMPLE_TIME,
        pull=np.asarray(pull_mm) * 1e-3,
        bend=np.zeros(count),
        measured_bend=np.radians(measured),
        joint_angle=np.empty((count, 0)),
        wire_tension=np.empty((count, 2, 0)),
        sheath_friction=np.empty((count, 2, 0)),
    )


@given(missing=st.lists(st.booleans(), min_size=2, max_size=40))
def test_pieces_hold_every_measured_step_once_and_in_order(missing):
    rng = np.random.default_rng(len(missing))
    episode = simple(rng.normal(size=len(missing)), np.where(missing, np.nan, rng.normal(size=len(missing))))
    known = np.flatnonzero(~np.array(missing))
    steps = [(k, k + 1) for k in known if k + 1 in known]  # what a model of hysteresis can be held to
    if not steps:
        with pytest.raises(ValueError, match="too much of the measured angle is missing"):
            complete_pieces(episode)
        return
    pieces = complete_pieces(episode)
    assert all(np.isfinite(pull).all() and np.isfinite(bend).all() for pull, bend in pieces)
    found = [pair for _, bend in pieces for pair in itertools.pairwise(bend)]
    measured = episode.measured_deg
    assert found == [(measured[k], measured[after]) for k, after in steps]
    found = [pair for pull, _ in pieces for pair in itertools.pairwise(pull)]
    assert found == [(episode.pull_mm[k], episode.pull_mm[after]) for k, after in steps]


def test_a_piece_in_which_the_command_stands_is_left_out():
    nan = np.nan
    episode = simple([0, 1, 1, 1, 1, 2, 1], [0, 1, nan, 3, 4, nan, 5])
    ((pull, bend),) = complete_pieces(episode)
    np.testing.assert_allclose(pull, [0, 1])
    np.testing.assert_allclose(bend, [0, 1])
    still = simple([1, 1, 1], [0, 1, 2])  # whole: what uses it says what is wrong with it
    assert len(complete_pieces(still)) == 1


HOLED = st.sampled_from(["", "nan", "1", "2.5", "-3", "4", "5"])


@settings(max_examples=15)
@given(
    angle=st.lists(HOLED, min_size=4, max_size=40).filter(
        lambda angle: sum(text not in ("", "nan") for text in angle) >= 2
    ),
    gaps=st.lists(st.sampled_from([0.1, 0.1, 0.1, 0.25, 2.0]), min_size=40, max_size=40),
    sample_time=st.sampled_from([0.05, 0.1, 0.3]),
)
def test_whatever_the_holes_nothing_that_is_computed_with_is_nan(tmp_path_factory, angle, gaps, sample_time):
    folder = tmp_path_factory.mktemp("holes")
    path = imported(folder, angle, np.cumsum(gaps[: len(angle)]))
    ((pull, bend),) = true_records([path], sample_time)
    assert np.isfinite(pull).all()
    assert np.isfinite(bend).all()
    try:
        (record,) = evaluation_records([path], sample_time)
    except ValueError as refused:
        fault = str(refused)
    else:
        fault = ""
        assert record.known[0]
        assert record.known.sum() >= 2
        assert len(record.pull_mm) == len(record.filled_deg) == len(record.known)
        np.testing.assert_allclose(
            record.filled_deg[record.known], bend[len(bend) - len(record.known) :][record.known], rtol=1e-12
        )
        np.testing.assert_array_equal(record.pull_mm, pull[len(pull) - len(record.known) :])
    assert fault == "" or fault.startswith("log: the angle is known at ")
