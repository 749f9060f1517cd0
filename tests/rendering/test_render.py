"""Pictures of an episode show the pose and the loop that the episode holds."""

import dataclasses

import av
import numpy as np
import pytest
from PIL import Image
from rendered import DOWN, SMALL, STRAIGHT, UP, make_episode, needs_gl

from twin.physics import simulate
from twin.preset.file import load_preset
from twin.rendering.actor import _chain
from twin.rendering.film import Film
from twin.rendering.loop_panel import LoopPanel
from twin.rendering.render import render, render_frame, render_mp4
from twin.rendering.still import render_png, telling_samples
from twin.rendering.video import read_frames


def drawn_rows(picture: np.ndarray) -> np.ndarray:
    """How many pixels of each row are not background, right of the shaft."""
    right = picture[:, picture.shape[1] // 2 :]
    return (right.min(axis=-1) < 200).sum(axis=1)


@needs_gl
def test_the_tip_is_seen_where_the_bend_puts_it():
    film = Film(make_episode(), **SMALL)
    centre = film.height // 2
    straight, up, down = (film.pose(sample) for sample in (STRAIGHT, UP, DOWN))

    assert drawn_rows(up)[:centre].sum() > 5 * drawn_rows(up)[centre + 12 :].sum()
    assert drawn_rows(down)[centre:].sum() > 5 * drawn_rows(down)[: centre - 12].sum()
    assert np.abs(up.astype(int) - straight).max() > 100

    for sample, picture in ((STRAIGHT, straight), (UP, up), (DOWN, down)):
        column, row = (round(value) for value in film.tip(sample))
        around = picture[row - 4 : row + 5, column - 4 : column + 5]
        assert around.min() < 80  # the tip is dark


@needs_gl
def test_what_rounds_to_zero_has_no_minus():
    """By comparison with an exact zero: the numbers are pixels by then."""
    episode = make_episode()
    zero, nearly = (
        dataclasses.replace(episode, bend=np.full(41, bend), pull=np.full(41, pull))
        for bend, pull in ((0.0, 0.0), (-1e-4, -1e-7))
    )
    corner = (slice(0, 60), slice(0, 80))
    shown, alike = (np.asarray(Film(one, **SMALL).frame(0))[corner] for one in (zero, nearly))
    np.testing.assert_array_equal(shown, alike)


@needs_gl
def test_both_wires_are_seen_in_their_colours():
    picture = Film(make_episode(), width=1280, height=720).pose(STRAIGHT).astype(int)
    red, green, blue = np.moveaxis(picture, -1, 0)
    is_red, is_blue = (red > green + 60) & (red > blue + 60), (blue > red + 60) & (blue > green + 30)
    assert is_red.sum() > 200
    assert is_blue.sum() > 200
    assert np.argwhere(is_red)[:, 0].mean() < np.argwhere(is_blue)[:, 0].mean()  # wire a is the upper one


@needs_gl
def test_a_record_without_hinges_is_drawn_with_constant_curvature():
    recorded, measured = make_episode(), make_episode(hinges=0)
    assert np.array_equal(render_frame(recorded, UP, **SMALL), render_frame(measured, UP, **SMALL))


@needs_gl
def test_frame_has_the_size_asked_for_and_the_episode_bounds_the_index():
    assert render_frame(make_episode(), -1, **SMALL).shape == (180, 320, 3)
    with pytest.raises(ValueError, match="samples 0 to 40"):
        render_frame(make_episode(), 41, **SMALL)
    with pytest.raises(ValueError, match="both must be even"):
        render_frame(make_episode(), 0, width=321, height=180)


def test_the_trace_grows_and_ends_at_the_sample():
    episode = make_episode()
    panel = LoopPanel(episode, 320, 240)
    pictures = [panel.draw(index).astype(int) for index in (2, 20, 40)]
    inked = [(picture[..., 0] - picture[..., 1] > 80).sum() for picture in pictures]
    assert inked[0] < inked[1] < inked[2]


def test_telling_samples_are_apart_at_the_same_pull():
    episode = make_episode()
    most, upper, lower, least = telling_samples(episode)
    assert episode.pull[most] == episode.pull.max()
    assert episode.pull[least] == episode.pull.min()
    assert abs(episode.pull[upper] - episode.pull[lower]) < 0.03 * np.ptp(episode.pull)
    assert episode.bend[upper] > episode.bend[lower]


@needs_gl
def test_png_is_whole_and_as_large_as_asked_for(tmp_path):
    path = render_png(make_episode(), tmp_path / "bend.png", dpi=80)
    picture = np.asarray(Image.open(path))
    assert picture.shape[:2] == (328, 720)
    assert picture[..., :3].std() > 20
    assert [file.name for file in tmp_path.iterdir()] == ["bend.png"]


@needs_gl
def test_mp4_decodes_to_every_frame(tmp_path):
    seen = []
    path = render_mp4(
        make_episode(),
        tmp_path / "bend.mp4",
        fps=10,
        speed=2,
        **SMALL,
        progress=lambda done, count: seen.append((done, count)),
    )
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate == 10
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert len(frames) == 21  # 4 s at double speed, both ends included
    drawn = Film(make_episode(), **SMALL).frame(10)
    assert frames[5].shape == drawn.shape == (180, 320, 3)
    assert np.abs(frames[5].astype(int) - drawn).mean() < 3
    assert seen == [(done, 21) for done in range(1, 22)]
    assert [file.name for file in tmp_path.iterdir()] == ["bend.mp4"]


@needs_gl
def test_a_film_that_is_interrupted_leaves_nothing(tmp_path):
    def stop(done: int, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_mp4(make_episode(), tmp_path / "bend.mp4", **SMALL, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_without_gl_the_package_to_install_is_named(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with pytest.raises(OSError, match="apt-get install libegl1") as error:
        render_frame(make_episode(), 0, **SMALL)
    assert "\n" not in str(error.value)


def test_tip_is_found_where_two_planes_bend_it():
    """The end of the chain that labels and framing rely on is where MuJoCo puts the tip."""
    preset = load_preset("ureteroscope").replace(bending_planes=2, vertebrae=6)
    pull = 2.5e-3 * np.sin(np.arange(40) * 0.1)
    tips = []
    episode = simulate(
        preset, pull, 0.02, lateral_pull=-0.8 * pull, on_sample=lambda e: tips.append(e.tip_position())
    )
    chain = _chain(episode.joint_angle, episode.lateral_joint_angle, preset.section_length)
    np.testing.assert_allclose(chain[:, -1], np.array(tips)[:, [0, 2]], atol=1e-6)


@needs_gl
def test_the_ending_of_the_path_says_what_is_drawn(tmp_path):
    episode = make_episode()
    assert render(episode, tmp_path / "bend.PNG") == tmp_path / "bend.PNG"
    render_png(episode, tmp_path / "same.png")
    assert (tmp_path / "bend.PNG").read_bytes() == (tmp_path / "same.png").read_bytes()
    render(episode, str(tmp_path / "bend.mp4"), fps=5, speed=2.0, **SMALL)
    frames = read_frames(tmp_path / "bend.mp4", 100)
    assert len(frames) == 11  # 4 s at twice the speed, both ends
    assert frames[0].shape == (180, 320, 3)


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"bend\.gif: must end in \.png or \.mp4$"):
        render(make_episode(), tmp_path / "bend.gif")
    assert not any(tmp_path.iterdir())
