"""Cameras: distortion as in OpenCV, exposure row by row, and the noise of the pixels as given."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seen import needs_gl

from twin.preset.file import load_preset
from twin.vision.bench import Bench, board_square, charuco_board, develop, instants, row_weights
from twin.vision.calibration import _corners
from twin.vision.optics import cv2, mounted_cameras
from twin.vision.rig import StereoRig, parse_rig, stereo_rig

PRESET = load_preset("ureteroscope")


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(-2, 2))
def test_pixels_and_normalised_places_are_there_and_back(seed, distortion):
    camera = mounted_cameras(PRESET, StereoRig(seed=seed, distortion=distortion))[0]
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (20, 3)) * PRESET.section_length
    seen = points @ camera.rotation.T + camera.translation
    places = camera.normalised(camera.project(points))
    np.testing.assert_allclose(places, seen[:, :2] / seen[:, 2:], atol=2e-5)
    np.testing.assert_allclose(camera.rotation @ camera.position + camera.translation, 0, atol=1e-12)


@needs_gl
def test_a_corner_is_seen_where_the_true_camera_projects_it():
    """Renderer, lens and projection agree to a twentieth of a pixel, distortion and all."""
    rig = StereoRig(pixel_noise=0.0, distortion=2.0, width=960, height=720)
    bench = Bench(PRESET, rig)
    square = board_square(PRESET)
    board = charuco_board(square)
    turn = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    position = np.array([0.43 * PRESET.section_length, 0.0, 0.0])
    pair = bench.take(lambda _: bench.show_board(position, turn), 0.0, np.random.default_rng(0))
    middle = np.array([4.5 * square, 3.5 * square, 0.0])
    axes = turn @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # of the board: right, down, into it
    for camera, picture in zip(bench.optics, pair, strict=True):
        found = _corners(cv2.aruco.CharucoDetector(board), picture)
        assert len(found) > 40
        known = (board.getChessboardCorners()[list(found)] - middle) @ axes.T + position
        off = np.array(list(found.values())) - camera.project(known)
        assert np.abs(off.mean(axis=0)).max() < 0.05
        assert np.sqrt(np.mean(off**2)) < 0.12


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 0.05), st.floats(0, 0.05), st.floats(0, 2000))
def test_rows_are_open_one_after_the_other_for_as_long_as_they_are_exposed(exposure, rolling, speed):
    """Of a scene that brightens evenly, a row shows the mean over the time for which it is open."""
    rig = StereoRig(exposure_s=exposure, rolling_shutter_s=rolling, height=121)
    when = instants(rig, speed)
    weights = row_weights(rig, when)
    np.testing.assert_allclose(weights.sum(axis=0), 1)
    if len(when) == 1:
        assert speed * (exposure + rolling) < 0.3
        return
    shown = when @ weights
    wanted = (np.arange(121) / 120 - 0.5) * rolling
    np.testing.assert_allclose(shown, wanted, atol=1e-9 + 0.02 * (exposure + rolling) / len(when))


@pytest.mark.parametrize("noise", [0.0, 3.0, 8.0])
def test_the_noise_of_pixels_is_as_given_and_more_in_the_light(noise):
    rig = StereoRig(pixel_noise=noise, blur_px=0.0)
    rng = np.random.default_rng(0)
    dark, grey, light = (
        develop(np.full((400, 400), level, np.float32), rig, rng).astype(float) for level in (40, 128, 215)
    )
    assert grey.mean() == pytest.approx(128, abs=0.1)
    assert grey.std() == pytest.approx(np.hypot(noise, 1 / np.sqrt(12) if noise else 0), rel=0.02, abs=1e-9)
    if noise:
        assert dark.std() < grey.std() < light.std()


def test_light_beyond_white_is_lost_and_blur_keeps_the_light():
    picture = np.zeros((60, 60), np.float32)
    picture[30, 30] = 200
    rng = np.random.default_rng(0)
    soft = develop(100 + picture, StereoRig(pixel_noise=0.0, blur_px=1.5), rng).astype(float) - 100
    assert soft.sum() == pytest.approx(200, rel=0.1)  # but for rounding
    assert (soft > 0).sum() > 9
    assert (develop(picture + 150, StereoRig(brightness=2.0), rng) == 255).all()


def test_a_rig_is_changed_by_words_and_refused_with_the_rule():
    words = ["method=silhouette", "blur_px=1.5", "width=800"]
    assert stereo_rig(parse_rig(words)) == StereoRig(method="silhouette", blur_px=1.5, width=800)
    for wrong, fault in (
        (["blurr_px=1"], r"unknown parameter 'blurr_px' \(did you mean 'blur_px'\?\)"),
        (["blur_px=wide"], "stereo blur_px = 'wide': must be a number"),
        (["method=3"], "stereo method = 3.0: must be a name"),
        (["method=lidar"], "stereo method 'lidar': must be one of markers, silhouette"),
        (["width=640.5"], "stereo width = 640.5: must be a whole number"),
        (["blur_px=-1"], "stereo blur_px = -1.0: must be from 0 to 10"),
        (["blur_px=nan"], "stereo blur_px = nan: must be from 0 to 10"),
        (["blur_px"], "stereo 'blur_px': must be NAME=VALUE"),
    ):
        with pytest.raises(ValueError, match=fault):
            stereo_rig(parse_rig(wrong))
