"""Two cameras measure the angle as well as they should, and give no angle where they cannot."""

import numpy as np
import pytest
from seen import needs_gl, record

from twin.preset.file import load_preset
from twin.rendering.actor import shape_of
from twin.vision import sensor as module
from twin.vision.rig import StereoRig
from twin.vision.sensor import StereoSensor

pytestmark = needs_gl
PRESET = load_preset("ureteroscope")
SEED = np.random.SeedSequence(1)
VIEWS = 12


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Fewer pictures of the straight endoscope."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_ZERO_PICTURES", 6)
        yield


@pytest.fixture(scope="module")
def sensor(quick) -> StereoSensor:
    return StereoSensor(PRESET, StereoRig(calibration_views=VIEWS))


def errors(sensor: StereoSensor, bend_deg: np.ndarray, **kw: float) -> np.ndarray:
    episode = record(bend_deg, **kw)
    return np.degrees(sensor.measure(episode, SEED) - episode.bend)


def other(preset=PRESET, **rig) -> StereoSensor:
    return StereoSensor(preset, StereoRig(calibration_views=VIEWS, **rig))


def test_calibration_finds_the_true_cameras(sensor):
    """To a hundredth of a degree between the two, and to what its pictures determine of each."""
    found, true = (sensor.calibration.left, sensor.calibration.right), sensor._bench.optics
    assert sensor.calibration.rms_px < 0.15
    for one, other in zip(found, true, strict=True):
        assert one.matrix[0, 0] == pytest.approx(other.matrix[0, 0], rel=0.015)
        assert one.distortion[0] == pytest.approx(other.distortion[0], abs=0.08)
    between = true[1].rotation @ true[0].rotation.T
    off = found[1].rotation @ between.T
    assert np.degrees(np.arccos((np.trace(off) - 1) / 2)) < 0.25
    baseline = np.linalg.norm(true[1].position - true[0].position)
    assert np.linalg.norm(found[1].translation) == pytest.approx(baseline, rel=0.015)


def test_angles_are_right_over_the_complete_range_and_depend_on_the_pose_more_than_on_noise(sensor):
    """The same angle twice has nearly the same error: the noise of a moving record is not white."""
    error = errors(sensor, np.repeat(np.linspace(-90, 90, 9), 2), sample_time=1.0)
    assert not np.isnan(error).any()
    assert np.sqrt(np.mean(error**2)) < 0.3
    assert abs(error.mean()) < 0.12
    pairs = error.reshape(-1, 2)
    assert np.diff(pairs).std() / np.sqrt(2) < 0.8 * pairs.mean(axis=1).std() + 0.02


def test_a_moving_endoscope_is_measured_at_the_middle_of_the_exposure(sensor):
    time = np.arange(10) * 0.2
    assert np.abs(errors(sensor, 60 * np.sin(2 * np.pi * time / 4), sample_time=0.2)).max() < 0.6


@pytest.mark.slow
def test_another_rig_has_other_errors_and_is_as_good(sensor):
    bends = np.linspace(-80, 80, 9)
    error = errors(other(seed=1), bends, sample_time=1.0)
    assert np.sqrt(np.mean(error**2)) < 0.3
    assert np.abs(error - errors(sensor, bends, sample_time=1.0)).max() > 0.05


@pytest.mark.slow
def test_a_rolling_shutter_sees_the_tip_late_or_early():
    """The tip is low in the pictures: its rows are read after the middle of the frame."""
    speed_deg = 60.0
    error = errors(other(rolling_shutter_s=0.06, blur_px=0.5), speed_deg * np.arange(-6, 7) * 0.1)
    assert 0.002 < np.nanmean(error) / speed_deg < 0.03


@pytest.mark.slow
def test_a_picture_does_not_depend_on_which_others_are_taken(sensor):
    episode = record(np.linspace(-30, 30, 11))
    every = dict(sensor.pictures(episode, SEED))
    some = dict(sensor.pictures(episode, SEED, 2.0))
    assert set(some) == {0, 5, 10}
    for sample, pair in some.items():
        for one, again in zip(pair, every[sample], strict=True):
            np.testing.assert_array_equal(one, again)


def test_the_same_seed_gives_the_same_angles_and_another_one_others(sensor):
    episode = record(np.linspace(-10, 10, 3))
    first = sensor.measure(episode, SEED)
    np.testing.assert_array_equal(first, sensor.measure(episode, SEED))
    assert (first != sensor.measure(episode, np.random.SeedSequence(2))).all()


@pytest.mark.slow
def test_hidden_markers_are_missing_and_never_far_wrong():
    sensor = other(occlusions_per_minute=60.0)
    time = np.arange(500) * 0.02
    episode = record(90 * np.sin(2 * np.pi * time / 24), sample_time=0.02)
    error = np.degrees(sensor.measure(episode, SEED) - episode.bend)[::5]
    assert 0.02 < np.isnan(error).mean() < 0.6
    assert np.nanmax(np.abs(error)) < 2.0
    assert len(sensor.passes(episode, SEED)) > 5


@pytest.mark.slow
def test_without_a_marker_the_silhouette_gives_the_angle():
    error = errors(other(method="silhouette"), np.linspace(-75, 75, 7), sample_time=1.0)
    assert np.isnan(error).sum() <= 1
    assert np.sqrt(np.nanmean(error**2)) < 1.0


@pytest.mark.slow
def test_two_planes_are_separated():
    bends, lateral = np.meshgrid([-50.0, 0.0, 50.0], [-30.0, 30.0])
    episode = record(bends.ravel(), sample_time=1.0, lateral_deg=lateral.ravel())
    error = np.degrees(other(shape_of(episode, 16)).measure(episode, SEED) - episode.bend)
    assert np.abs(error).max() < 4.0  # an even arc is taken for the section's
    assert np.abs(error[np.abs(episode.bend) < 0.1]).max() < 1.0


@pytest.mark.parametrize("change", [{"blur_px": 10.0}, {"brightness": 0.05}])
def test_a_rig_that_sees_nothing_is_refused_in_one_line(change):
    with pytest.raises(ValueError, match="less blur") as refused:
        StereoSensor(PRESET, StereoRig(calibration_views=6, **change))
    assert "\n" not in str(refused.value)
