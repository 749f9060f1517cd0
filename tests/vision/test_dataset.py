"""A dataset that two cameras measured: what is in its files, and that it can be made again."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recorded import messages
from seen import needs_gl
from small_dataset import SMALL, changed, make

from twin.dataset.recipe_file import load_recipe, parse_recipe, resolve
from twin.dataset.verify import replay, verify
from twin.evaluation.reading import recorded_variance
from twin.recording import read_episode
from twin.signals.noise import noise_variance
from twin.vision.rig import StereoRig
from twin.vision.sensor import sensor_before

RIG = StereoRig(pictures_per_second=2.0, calibration_views=8)
RECIPE = changed(stereo=RIG, episodes=2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seen") / "data"
    make(folder, RECIPE)
    return folder


@needs_gl
def test_measurements_come_from_pictures_at_their_times(folder):
    episode = read_episode(folder / "episode_0000.mcap")
    seen = ~np.isnan(episode.measured_bend)
    np.testing.assert_array_equal(np.flatnonzero(seen), np.arange(0, 50, 5))
    error = np.degrees(episode.measured_bend - episode.bend)[seen]
    assert 0 < np.abs(error).max() < 0.8
    assert recorded_variance(episode) == noise_variance("stereo-vision", 0.0)


@needs_gl
def test_cameras_change_nothing_but_the_measurement(folder, tmp_path):
    make(tmp_path / "plain", changed(episodes=2))
    for name in ("episode_0000.mcap", "episode_0001.mcap"):
        one, other = read_episode(folder / name), read_episode(tmp_path / "plain" / name)
        for quantity in ("time", "pull", "bend", "wire_tension"):
            np.testing.assert_array_equal(getattr(one, quantity), getattr(other, quantity))


@needs_gl
def test_each_camera_states_its_calibration_and_its_pictures(folder):
    path = folder / "episode_0001.mcap"
    seen, sensor = messages(path), sensor_before(read_episode(path), RIG)
    for side in ("left", "right"):
        ((record, calibration),) = seen[f"/camera/{side}/calibration"]
        optics = getattr(sensor.calibration, side)
        assert record.log_time == 0
        assert (calibration.width, calibration.height) == (640, 480)
        assert calibration.distortion_model == "plumb_bob"
        np.testing.assert_array_equal(np.reshape(calibration.K, (3, 3)), optics.matrix)
        np.testing.assert_array_equal(calibration.D, optics.distortion)
        pictures = seen[f"/camera/{side}/image"]
        assert [record.log_time for record, _ in pictures] == [0, 500_000_000]
        for _, message in pictures:
            assert message.frame_id == calibration.frame_id == f"camera_{side}"
            assert Image.open(io.BytesIO(message.data)).size == (640, 480)


@needs_gl
def test_projections_of_the_calibration_triangulate_the_tip(folder):
    """As in ROS: P projects what R turned; equal rows in both, the shift gives the depth."""
    path = folder / "episode_0000.mcap"
    sensor, seen = sensor_before(read_episode(path), RIG), messages(path)
    point = np.array([SMALL.section_length, 0.002, 0.001])  # of space; below, in the left camera's axes
    true = sensor._bench.optics[0]
    local = true.rotation @ point + true.translation
    pixels = []
    for side in ("left", "right"):
        ((_, message),) = seen[f"/camera/{side}/calibration"]
        projection, turn = np.reshape(message.P, (3, 4)), np.reshape(seen_turn(seen), (3, 3))
        x, y, w = projection @ [*(turn @ local), 1.0]
        pixels.append((x / w, y / w))
    (left, row), (right, other_row) = pixels
    assert row == pytest.approx(other_row, abs=1e-6)
    focal, shift = projection[0, 0], projection[0, 3]
    assert -shift / (left - right) == pytest.approx((turn @ local)[2], rel=1e-6)
    assert focal > 100


def seen_turn(seen):
    """R of the left camera: from its axes to the common plane."""
    ((_, message),) = seen["/camera/left/calibration"]
    return message.R


@needs_gl
def test_the_dataset_is_whole_and_made_again_to_the_byte(folder):
    assert verify(folder) == ([], 2)
    assert replay(folder / "episode_0001.mcap").same
    assert load_recipe(folder / "recipe.yaml").stereo == RIG
    card = (folder / "README.md").read_text()
    assert "two calibrated cameras, 10 pairs of pictures per second, angle by a marker on the tip" in card
    assert "/camera/left/..." in card
    assert "noise is drawn" not in card


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("sensor: {stereo: true, noise_deg: 1}", "sensor: stereo and noise_deg: choose one"),
        ("sensor: {stereo: {blurr_px: 1}}", "did you mean 'blur_px'"),
        ("sensor: {stereo: {blur_px: 99}}", "stereo blur_px = 99.0: must be from 0 to 10"),
    ],
)
def test_cameras_that_cannot_be_are_refused(text, fault):
    with pytest.raises(ValueError, match=fault):
        resolve(parse_recipe(text), Path())
