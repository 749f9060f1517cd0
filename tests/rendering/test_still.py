"""Pictures for print: the right samples, the size and resolution asked for, every background and format."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from rendered import UP, in_two_planes, ink, make_episode, needs_gl, with_tension

from twin.rendering.look import CAMERAS, Look
from twin.rendering.overlay import Overlay
from twin.rendering.render import render
from twin.rendering.still import keyframes, spread

EPISODE = make_episode()
SIZE = (300, 140)


def picture_of(path) -> np.ndarray:
    return np.asarray(Image.open(path))


def test_keyframes_are_apart_at_the_same_pull():
    most, upper, lower, least = keyframes(EPISODE)
    assert EPISODE.pull[most] == EPISODE.pull.max()
    assert EPISODE.pull[least] == EPISODE.pull.min()
    assert abs(EPISODE.pull[upper] - EPISODE.pull[lower]) < 0.03 * np.ptp(EPISODE.pull)
    assert EPISODE.bend[upper] > EPISODE.bend[lower]


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=6), st.floats(0.1, 50))
def test_numbers_are_spread_in_their_order_about_their_middle(levels, apart):
    moved = spread(levels, apart)
    assert np.mean(moved) == pytest.approx(np.mean(levels), abs=1e-6)
    in_order = np.array(moved)[np.argsort(levels, kind="stable")]
    assert (np.diff(in_order) >= apart - 1e-6).all()


@needs_gl
def test_a_png_has_the_size_and_the_resolution_asked_for(tmp_path):
    image = Image.open(render(EPISODE, tmp_path / "bend.PNG", look=Look(size=(640, 300), dpi=150)))
    assert image.size == (640, 300)
    assert image.info["dpi"] == pytest.approx((150, 150), abs=0.1)
    assert np.asarray(image)[..., :3].std() > 20
    assert [file.name for file in tmp_path.iterdir()] == ["bend.PNG"]
    by_resolution = (
        (EPISODE, (540, 246)),
        (in_two_planes(EPISODE), (540, 389)),
        ([Overlay(EPISODE, title=name) for name in "abc"], (540, 335)),
    )
    for shown, size in by_resolution:
        assert Image.open(render(shown, tmp_path / "by_dpi.png", look=Look(dpi=60))).size == size


@needs_gl
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_the_same_picture_is_the_same_bytes(tmp_path, ending):
    look = Look(size=SIZE, dpi=60)
    one, other = (render(EPISODE, tmp_path / f"{name}.{ending}", look=look).read_bytes() for name in "ab")
    assert one == other


@needs_gl
def test_a_transparent_picture_lies_on_any_background(tmp_path):
    """Over white it is as the white one, but for the rounding of the edges."""
    clear, white = (
        render(EPISODE, tmp_path / f"{kind}.png", look=Look(size=SIZE, background=kind))
        for kind in ("transparent", "white")
    )
    image = Image.open(clear)
    assert (np.asarray(image)[..., 3] == 0).mean() > 0.4
    paper = Image.new("RGBA", image.size, "white")
    paper.alpha_composite(image)
    off = np.asarray(paper)[..., :3].astype(int) - picture_of(white)[..., :3]
    assert np.abs(off).max() <= 3
    assert np.abs(off).mean() < 0.2


def test_curves_are_vectors_in_svg_and_pdf_and_text_is_text(tmp_path):
    look = Look(size=SIZE, panels="curves")
    svg = render(EPISODE, tmp_path / "loop.svg", look=look).read_text()
    assert "bending angle [deg]" in svg
    assert "<image" not in svg
    assert len(re.findall(r"<path", svg)) > 5
    pdf = render(EPISODE, tmp_path / "loop.pdf", look=look).read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/Subtype /Image" not in pdf


@needs_gl
def test_a_picture_at_a_time_is_the_pose_of_that_time(tmp_path):
    look, upper = Look(size=(400, 300), panels="view"), (slice(0, 110), slice(200, 400))
    up, straight = (
        picture_of(render(EPISODE, tmp_path / f"{time}.png", look=look, time=time))[..., :3]
        for time in (1.0, 0.0)
    )
    assert ink(up)[upper].max() > 150  # right of the numbers
    assert ink(straight)[upper].max() < 60


@needs_gl
@pytest.mark.parametrize("camera", CAMERAS)
def test_every_camera_draws_a_picture_of_its_own(tmp_path, camera):
    look = Look(size=(300, 144), camera=camera, panels="view", dpi=120)
    picture = picture_of(render(with_tension(EPISODE), tmp_path / "a.png", look=look, time=0.7))[..., :3]
    assert (ink(picture) > 100).mean() > 0.01
    assert (picture == 255).all(axis=-1).mean() > 0.3


@pytest.mark.parametrize(
    ("name", "options", "fault"),
    [
        ("a.bmp", {}, r"a\.bmp: must end in \.png, \.svg, \.pdf, \.mp4 or \.gif$"),
        ("a.mp4", {"time": 1.0}, r"^time = 1: is of a picture, not of a film \(\.mp4\)$"),
        ("a.gif", {"sheet": 4}, r"^sheet = 4: is of a picture, not of a film \(\.gif\)$"),
        ("a.png", {"sheet": 4, "time": 1.0}, "^sheet = 4: shows even times of one record"),
        ("a.png", {"sheet": 61}, "^sheet = 61: must be from 2 to 60 pictures$"),
        ("a.png", {"time": -0.1}, r"^time = -0.1: must be from 0 to 4 s, the length of the record$"),
        ("a.png", {"time": np.nan}, r"^time = nan: must be from 0 to 4 s, the length of the record$"),
        ("a.mp4", {"look": Look(background="transparent")}, "^background = transparent: is of a picture"),
        ("a.mp4", {"look": Look(size=(321, 180))}, "^size 321 x 180: both must be even, from 160 x 120"),
        ("a.png", {"look": Look(size=(100, 100))}, "^size 100 x 100: must be from 160 x 120 to 10000 x"),
        ("a.gif", {"fps": 60}, "^fps 60 and speed 1: must be positive, at most 50 and 1000$"),
    ],
)
def test_what_cannot_be_drawn_is_refused_and_leaves_nothing(tmp_path, name, options, fault):
    with pytest.raises(ValueError, match=fault):
        render(EPISODE, tmp_path / name, **options)
    assert not any(tmp_path.iterdir())


@needs_gl
def test_the_sleeve_hides_the_wires_or_shows_them(tmp_path):
    """Wire a is red, wire b blue: neither is seen through a complete sleeve."""
    colours = {}
    for sleeve in ("cut", "whole", "none"):
        look = Look(size=(640, 400), panels="view", sleeve=sleeve)
        picture = picture_of(render(EPISODE, tmp_path / f"{sleeve}.png", look=look, time=UP / 10))
        endoscope = picture[:, 240:, :3].astype(int)  # right of the numbers, which are red too
        colours[sleeve] = (np.ptp(endoscope, axis=-1) > 90).sum()
    assert colours["whole"] < 0.1 * colours["cut"]
    assert colours["cut"] <= colours["none"]
