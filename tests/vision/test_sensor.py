"""Two cameras measure the angle as well as they should, and say so where they cannot."""

import dataclasses

import numpy as np
import pytest
from seen import needs_gl, record

from twin.preset.file import load_preset
from twin.rendering.actor import shape_of
from twin.vision.characteristic import grid_errors, occluded
from twin.vision.rig import StereoRig
from twin.vision.sensor import StereoSensor, frame_samples, sensor_before

pytestmark = needs_gl
PRESET = load_preset("ureteroscope")
SEED = np.random.SeedSequence(1)


@pytest.fixture(scope="module")
def sensor() -> StereoSensor:
    return StereoSensor(PRESET, StereoRig())


def errors(sensor: StereoSensor, bend_deg: np.ndarray, **kw: float) -> np.ndarray:
    episode = record(bend_deg, **kw)
    return np.degrees(sensor.measure(episode, SEED) - episode.bend)


def test_calibration_finds_the_true_cameras(sensor):
    """To a hundredth of a degree between the two, and to what its pictures can tell of each."""
    found, true = (sensor.calibration.left, sensor.calibration.right), sensor._bench.optics
    assert sensor.calibration.rms_px < 0.15
    for one, other in zip(found, true, strict=True):
        assert one.matrix[0, 0] == pytest.approx(other.matrix[0, 0], rel=0.01)
        assert one.distortion[0] == pytest.approx(other.distortion[0], abs=0.08)
    between = true[1].rotation @ true[0].rotation.T
    off = found[1].rotation @ between.T
    assert np.degrees(np.arccos((np.trace(off) - 1) / 2)) < 0.25
    baseline = np.linalg.norm(true[1].position - true[0].position)
    assert np.linalg.norm(found[1].translation) == pytest.approx(baseline, rel=0.01)


def test_angles_are_right_over_the_whole_range_and_no_frame_is_lost():
    error = grid_errors(PRESET, StereoRig(), np.linspace(-90, 90, 19), 1)
    assert not np.isnan(error).any()
    assert np.sqrt(np.mean(error**2)) < 0.3
    assert abs(error.mean()) < 0.1


def test_another_rig_has_other_errors_and_is_as_good():
    bends = np.linspace(-80, 80, 9)
    error = grid_errors(PRESET, StereoRig(seed=1), bends, 1)
    assert np.sqrt(np.mean(error**2)) < 0.3
    assert np.abs(error - grid_errors(PRESET, StereoRig(), bends, 1)).max() > 0.05


def test_errors_depend_on_the_pose_more_than_on_chance(sensor):
    """The same angle twice has nearly the same error: the noise of a moving record is not white."""
    bends = np.repeat(np.linspace(-60, 60, 9), 2)
    error = errors(sensor, bends, sample_time=1.0).reshape(-1, 2)
    assert np.diff(error).std() / np.sqrt(2) < 0.8 * error.mean(axis=1).std() + 0.02


def test_a_moving_endoscope_is_measured_at_the_middle_of_the_exposure(sensor):
    time = np.arange(20) * 0.1
    assert np.abs(errors(sensor, 60 * np.sin(2 * np.pi * time / 4))).max() < 0.6


def test_a_rolling_shutter_sees_the_tip_late_or_early():
    """The tip is low in the pictures: its rows are read after the middle of the frame."""
    rig = StereoRig(rolling_shutter_s=0.06, blur_px=0.5)
    rolling = StereoSensor(PRESET, rig)
    speed_deg = 60.0
    error = errors(rolling, speed_deg * np.arange(-6, 7) * 0.1)
    late = np.nanmean(error) / speed_deg
    assert 0.002 < late < 0.03


def test_pictures_are_taken_at_the_rate_of_the_rig(sensor):
    assert frame_samples(np.arange(50) * 0.02, 10.0) == list(range(0, 50, 5))
    measured = sensor.measure(record(np.zeros(50), sample_time=0.02), SEED)
    np.testing.assert_array_equal(np.flatnonzero(~np.isnan(measured)), np.arange(0, 50, 5))


def test_a_picture_does_not_depend_on_which_others_are_taken(sensor):
    episode = record(np.linspace(-30, 30, 21))
    whole = dict(sensor.pictures(episode, SEED))
    some = dict(sensor.pictures(episode, SEED, 2.0))
    assert set(some) == {0, 5, 10, 15, 20}
    for sample, pair in some.items():
        for one, other in zip(pair, whole[sample], strict=True):
            np.testing.assert_array_equal(one, other)


def test_the_same_seed_gives_the_same_angles_and_another_one_others(sensor):
    episode = record(np.linspace(-30, 30, 5))
    first = sensor.measure(episode, SEED)
    np.testing.assert_array_equal(first, sensor.measure(episode, SEED))
    assert (first != sensor.measure(episode, np.random.SeedSequence(2))).all()


def test_hidden_markers_are_missing_and_never_far_wrong():
    rig = StereoRig(occlusions_per_minute=60.0)
    seen = occluded(PRESET, rig, 100)
    missing = np.isnan(seen.error_deg)
    assert 0.02 < missing.mean() < 0.6
    assert np.nanmax(np.abs(seen.error_deg)) < 2.0
    assert seen.passes > 5
    assert seen.hidden_s.sum() == pytest.approx(missing.sum() / rig.frames_per_second)


def test_without_a_marker_the_silhouette_tells_the_angle():
    rig = StereoRig(method="silhouette")
    error = grid_errors(PRESET, rig, np.linspace(-75, 75, 7), 1)
    assert np.isnan(error).sum() <= 1
    assert np.sqrt(np.nanmean(error**2)) < 1.0


def test_two_planes_are_told_apart():
    bends, lateral = np.meshgrid([-50.0, 0.0, 50.0], [-30.0, 30.0])
    episode = record(bends.ravel(), sample_time=1.0, lateral_deg=lateral.ravel())
    two = StereoSensor(shape_of(episode, 16), StereoRig())
    error = np.degrees(two.measure(episode, SEED) - episode.bend)
    assert np.abs(error).max() < 4.0  # an even arc is taken for the section's
    assert np.abs(error[np.abs(episode.bend) < 0.1]).max() < 1.0


def test_a_thick_manipulator_is_measured_too():
    error = grid_errors(load_preset("vio_com"), StereoRig(), np.linspace(-40, 40, 5), 1)
    assert np.sqrt(np.mean(error**2)) < 0.3


def test_a_rig_that_sees_nothing_is_refused_in_one_line():
    for change in ({"blur_px": 10.0}, {"brightness": 0.05}):
        with pytest.raises(ValueError, match="less blur") as refused:
            StereoSensor(PRESET, dataclasses.replace(StereoRig(), **change))
        assert "\n" not in str(refused.value)


def test_a_sensor_is_set_up_once_for_endoscopes_of_one_shape():
    episode = record(np.zeros(3))
    assert sensor_before(episode, StereoRig()) is sensor_before(record(np.ones(4)), StereoRig())
