"""An episode holds arrays that belong together, converts units once and thins without inventing samples."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.episode import Episode, Record

PER_SAMPLE = ("pull", "bend", "measured_bend", "joint_angle", "wire_tension", "sheath_friction")


def make_arrays(samples: int = 20, sample_time: float = 0.02) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {
        "time": np.arange(samples) * sample_time,
        "pull": rng.normal(size=samples) * 1e-3,
        "bend": rng.normal(size=samples),
        "measured_bend": rng.normal(size=samples),
        "joint_angle": rng.normal(size=(samples, 3)),
        "wire_tension": rng.normal(size=(samples, 2, 5)),
        "sheath_friction": rng.normal(size=(samples, 2, 4)),
    }


def make_episode(samples: int = 20, sample_time: float = 0.02) -> Episode:
    return Episode(**make_arrays(samples, sample_time), metadata={"seed": 1}, attachments={"a": b"b"})


@pytest.mark.parametrize("field", PER_SAMPLE)
def test_array_of_another_length_is_refused_by_name(field):
    arrays = make_arrays()
    arrays[field] = arrays[field][:-1]
    with pytest.raises(ValueError, match=f"^{field} has 19 samples, time has 20$"):
        Episode(**arrays)


@pytest.mark.parametrize("field", PER_SAMPLE)
@pytest.mark.parametrize("gap", [np.nan, np.inf, -np.inf])
def test_gap_is_refused_with_its_place(field, gap):
    arrays = make_arrays()
    arrays[field][7:9] = gap
    if field == "measured_bend" and np.isnan(gap):
        assert np.isnan(Episode(**arrays).measured_deg).sum() == 2  # a measurement may be missing
        return
    with pytest.raises(ValueError, match=f"^{field} is not finite at sample 7$"):
        Episode(**arrays)


@pytest.mark.parametrize("times", [(0.1, 0.1), (0.2, 0.1), (0.1, np.nan), (np.inf, 0.2), (0.1, np.inf)])
def test_time_that_does_not_increase_is_refused(times):
    arrays = make_arrays(20)
    arrays["time"] = np.concatenate([np.arange(18) * 1e-3, times])
    with pytest.raises(ValueError, match="time must increase"):
        Episode(**arrays)


@pytest.mark.parametrize("samples", [0, 1])
def test_record_needs_two_samples(samples):
    with pytest.raises(ValueError, match=f"at least 2 samples, got {samples}"):
        make_episode(samples)
    assert make_episode(2).sample_time == pytest.approx(0.02)


def test_millimetres_and_degrees_at_the_edge():
    arrays = make_arrays(3)
    arrays |= {
        "pull": np.array([0.0, 1e-3, -4.5e-3]),
        "bend": np.array([0.0, np.pi, -np.pi / 2]),
        "measured_bend": np.array([np.pi / 180, np.pi / 4, 0.0]),
    }
    episode = Episode(**arrays)
    np.testing.assert_allclose(episode.pull_mm, [0.0, 1.0, -4.5], rtol=1e-15)
    np.testing.assert_allclose(episode.truth_deg, [0.0, 180.0, -90.0], rtol=1e-15)
    np.testing.assert_allclose(episode.measured_deg, [1.0, 45.0, 0.0], rtol=1e-15)


def test_sample_time_is_the_usual_one_where_a_sample_is_late():
    arrays = make_arrays()
    arrays["time"][10:] += 0.5
    assert Episode(**arrays).sample_time == pytest.approx(0.02)


@given(step=st.integers(1, 8), sample_time=st.sampled_from([0.001, 0.01, 0.02, 0.1, 1 / 30]))
def test_thinned_record_is_every_nth_sample_of_every_array(step, sample_time):
    episode = make_episode(20, sample_time)
    thin = episode.resampled(step * sample_time)
    for field in ("time", *PER_SAMPLE):
        np.testing.assert_array_equal(getattr(thin, field), getattr(episode, field)[::step])
    assert thin.sample_time == pytest.approx(step * sample_time)
    assert (thin.metadata, thin.attachments) == (episode.metadata, episode.attachments)


@pytest.mark.parametrize("sample_time", [0.03, 0.0201, 1 / 30])
def test_sample_time_that_is_no_multiple_is_interpolated(sample_time):
    episode = make_episode()
    thin = episode.resampled(sample_time)
    assert thin.sample_time == pytest.approx(sample_time)
    np.testing.assert_allclose(thin.pull, np.interp(thin.time, episode.time, episode.pull))


@pytest.mark.parametrize("sample_time", [0.01, 0.0, -0.02])
def test_sample_time_below_that_of_the_record_is_refused(sample_time):
    with pytest.raises(ValueError, match=r"must be at least the record's 0\.02 s"):
        make_episode().resampled(sample_time)


def test_thinning_to_a_single_sample_is_refused():
    with pytest.raises(ValueError, match="at least 2 samples, got 1"):
        make_episode(20).resampled(0.4)


def holed(missing, time=None):
    episode = make_episode(40)
    measured = np.where(missing, np.nan, episode.measured_bend)
    return dataclasses.replace(
        episode, measured_bend=measured, **({} if time is None else {"time": np.asarray(time)})
    )


@given(missing=st.lists(st.booleans(), min_size=40, max_size=40), start=st.sampled_from([0.0, 0.1, 1e6]))
def test_a_record_on_its_own_samples_keeps_its_holes(missing, start):
    episode = holed(missing, start + np.arange(40) * 0.02)
    even = episode.resampled(0.02, "interpolate")
    np.testing.assert_array_equal(np.isnan(even.measured_bend), missing)
    for field in PER_SAMPLE:
        np.testing.assert_allclose(getattr(even, field), getattr(episode, field), atol=1e-6)


@given(
    steps=st.lists(st.sampled_from([0.01, 0.02, 0.02, 0.025, 0.3, 2.0]), min_size=39, max_size=39),
    missing=st.lists(st.sampled_from([False, False, False, True]), min_size=40, max_size=40),
    sample_time=st.sampled_from([0.005, 0.02, 0.1, 0.37]),
)
def test_even_samples_are_missing_between_measurements_far_apart_and_linear_elsewhere(
    steps, missing, sample_time
):
    episode = holed(missing, np.concatenate([[0.0], np.cumsum(steps)]))
    even = episode.resampled(sample_time, "interpolate")
    reach = max(sample_time, episode.sample_time)
    assert np.isfinite(even.bend).all()
    known = ~np.array(missing)
    seen = ~np.isnan(even.measured_bend)
    away = episode.time[known] - even.time[:, None]
    apart = np.where(away > 1e-9, away, np.inf).min(axis=1, initial=np.inf)
    apart -= np.where(away < -1e-9, away, -np.inf).max(axis=1, initial=-np.inf)
    near = (np.abs(away) <= 1e-9).any(axis=1) | (apart < 2 * reach * (1 - 1e-4))
    clear = near | (apart > 2 * reach * (1 + 1e-4))  # at two sample times themselves rounding may decide
    np.testing.assert_array_equal(seen[clear], near[clear])
    if seen.any():
        linear = np.interp(even.time[seen], episode.time[known], episode.measured_bend[known])
        np.testing.assert_allclose(even.measured_bend[seen], linear, atol=1e-9)


def test_a_record_without_any_measurement_has_none_on_even_samples():
    assert np.isnan(holed([True] * 40).resampled(0.05, "interpolate").measured_bend).all()


def test_an_even_grid_that_would_fill_the_memory_is_refused():
    episode = dataclasses.replace(make_episode(3), time=np.array([0.0, 0.1, 1e9]))
    with pytest.raises(ValueError, match=r"a record of 1e\+09 s would be more than 10000000 samples"):
        episode.resampled(0.1, "interpolate")


def test_repr_is_three_lines_of_what_it_is_and_not_its_arrays():
    arrays = make_arrays()
    arrays["pull"] = np.linspace(1e-3, 4e-3, 20)
    arrays["bend"] = np.radians(np.linspace(-5, 70, 20))
    arrays["measured_bend"][3:5] = np.nan
    facts = {"preset": {"name": "ureteroscope"}, "signal": "sine", "seed": 7, "episode": 2}
    assert repr(Episode(**arrays, metadata=facts)).splitlines() == [
        "Episode of ureteroscope, signal sine, seed 7, episode 2",
        "  20 samples every 0.02 s, 0.38 s; pull 1.00 to 4.00 mm, bend -5.0 to 70.0 deg",
        "  recorded: time, pull, bend, measured_bend (2 missing), joint_angle, wire_tension, sheath_friction",
    ]
    measured = Episode(**arrays, metadata={"source": "measured", "name": "loop"})
    assert repr(measured).startswith("Episode 'loop', measured\n")
    assert repr(Episode(**arrays)).startswith("Episode of unknown origin\n")


def test_record_has_the_columns_of_an_estimator():
    arrays = make_arrays()
    facts = {"preset": {"name": "ureteroscope"}, "twin": "reduced", "episode": 2, "stroke_mm": [0, 4]}
    record = Episode(**arrays, metadata=facts).record()
    np.testing.assert_array_equal(record.pull_mm, arrays["pull"] * 1e3)
    np.testing.assert_array_equal(record.reference_deg, np.degrees(arrays["bend"]))
    np.testing.assert_array_equal(record.measured_deg, np.degrees(arrays["measured_bend"]))
    assert (record.name, record.source, record.preset) == ("episode_0002", "reduced", "ureteroscope")
    assert record.stroke_mm == (0, 4)
    assert not record.is_measured
    measured = Episode(**arrays, metadata={"source": "measured"}).record(number=7)
    assert (measured.name, measured.source, measured.preset) == ("episode_0007", "measured", "")
    assert np.isnan(measured.truth_deg).all()
    np.testing.assert_array_equal(measured.reference_deg, measured.measured_deg)
    assert measured.stroke_mm == tuple(np.round([record.pull_mm.min(), record.pull_mm.max()], 1))


@pytest.mark.parametrize("method", ["thin", "nearest", "interpolate"])
@given(missing=st.lists(st.booleans(), min_size=40, max_size=40))
def test_record_and_episode_are_resampled_alike(method, missing):
    episode = holed(missing)
    whole, even = episode.record().resampled(0.06, method), episode.resampled(0.06, method).record()
    for name in ("time", "pull_mm", "truth_deg", "measured_deg"):
        np.testing.assert_allclose(getattr(whole, name), getattr(even, name), atol=1e-12)


def test_records_of_several_twins_share_a_command():
    rng = np.random.default_rng(1)
    truth = rng.normal(size=(2, 3, 20))
    estimates = {"EKF": truth + 1.0}
    record = Record(np.arange(20) * 0.1, rng.normal(size=(2, 1, 20)), truth, estimates=estimates)
    assert np.isnan(record.measured_deg).all()
    np.testing.assert_allclose(record.error_deg("EKF"), 1.0)
    thin = record.part(4).resampled(0.2)
    np.testing.assert_array_equal(thin.truth_deg, truth[..., 4::2])
    np.testing.assert_allclose(thin.error_deg("EKF"), 1.0)
    assert thin.resampled(0.3, "nearest").time.tolist() == thin.time[::2].tolist()
    with pytest.raises(ValueError, match="no estimates of 'UKF'; there are: EKF"):
        record.error_deg("UKF")
    with pytest.raises(ValueError, match="truth_deg has 19 samples, time has 20"):
        dataclasses.replace(record, truth_deg=truth[..., 1:])
