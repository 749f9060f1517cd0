"""Frames of a film show the pose, the numbers and the loop that the episode holds."""

import dataclasses

import numpy as np
import pytest
from rendered import DOWN, SMALL, STRAIGHT, UP, film, in_two_planes, make_episode, needs_gl, with_tension

from twin.rendering.look import WHITE, Look
from twin.rendering.overlay import Overlay
from twin.rendering.picture import on_paper
from twin.rendering.render import Film


def pose(movie, sample: int) -> np.ndarray:
    """The endoscope alone, on white."""
    return on_paper(movie.composition.views[0].pose(sample), WHITE)


def drawn_rows(picture: np.ndarray) -> np.ndarray:
    """How many pixels of each row are not background, right of the shaft."""
    right = picture[:, picture.shape[1] // 2 :]
    return (right.min(axis=-1) < 200).sum(axis=1)


@needs_gl
def test_the_tip_is_seen_where_the_bend_puts_it():
    movie = film(make_episode())
    view = movie.composition.views[0]
    base = round(view.shot.view(view.actors[0], 0).project(np.zeros(3), *view.box[2:])[1])
    straight, up, down = (pose(movie, sample) for sample in (STRAIGHT, UP, DOWN))

    assert drawn_rows(up)[:base].sum() > 5 * drawn_rows(up)[base + 12 :].sum()
    assert drawn_rows(down)[base:].sum() > 5 * drawn_rows(down)[: base - 12].sum()
    assert np.abs(up.astype(int) - straight).max() > 100

    for sample, picture in ((STRAIGHT, straight), (UP, up), (DOWN, down)):
        column, row = (round(value) for value in view.tip(sample))
        around = picture[row - 4 : row + 5, column - 4 : column + 5]
        assert around.min() < 80  # the tip is dark


@needs_gl
def test_the_wire_that_is_pulled_is_the_brighter_one():
    """Pulled, wire a on the upper side; pushed, wire b on the lower one."""
    episode = with_tension(make_episode(amplitude_deg=2))
    movie = film(episode, size=(1280, 720))
    pulled, pushed = int(episode.pull.argmax()), int(episode.pull.argmin())
    up, down = (pose(movie, sample).astype(int) for sample in (pulled, pushed))
    view = movie.composition.views[0]
    middle = round(view.tip(STRAIGHT)[1])
    warm = (np.abs(up - down).max(axis=-1) > 40) & (up[..., 0] > up[..., 2] + 60)
    assert warm[:middle].sum() > 50
    assert warm[middle:].sum() < 0.2 * warm[:middle].sum()


@needs_gl
def test_a_record_without_hinges_is_drawn_with_constant_curvature():
    recorded, measured = make_episode(), make_episode(hinges=0)
    np.testing.assert_array_equal(film(recorded).frame(UP), film(measured).frame(UP))


@needs_gl
def test_the_same_episode_gives_the_same_pixels_in_any_order():
    one, other = film(make_episode()), film(make_episode())
    forwards = [one.frame(sample) for sample in (0, UP, DOWN)]
    backwards = [other.frame(sample) for sample in (DOWN, UP, 0)][::-1]
    for first, second in zip(forwards, backwards, strict=True):
        np.testing.assert_array_equal(first, second)


@needs_gl
def test_two_planes_have_two_views_and_two_loops_and_both_angles():
    episode = in_two_planes(make_episode())
    movie = film(episode, size=(640, 480))
    assert [view.is_lateral for view in movie.composition.views] == [False, True]
    assert [cell.plot.is_main for cell in movie.composition.plots] == [True, False]
    np.testing.assert_allclose(movie.composition.plots[1].plot.bend_deg, np.degrees(episode.lateral_bend))
    _, lateral = (view.marks(UP + 10) for view in movie.composition.views)
    assert {"lateral bending angle", "+40.0°"} <= {getattr(mark, "text", "") for mark in lateral}
    above = movie.composition.views[1]
    assert above.tip(UP + 10)[1] < above.tip(STRAIGHT)[1] - 20  # towards wire c is up


@needs_gl
def test_records_side_by_side_have_common_axes_and_scale_and_the_shorter_one_stands_still():
    long, short = make_episode(), make_episode(amplitude_deg=20)
    short = dataclasses.replace(
        short, **{name: value[:20] for name, value in vars(short).items() if len(value) == 41}
    )
    movie = Film([Overlay(long, title="a"), Overlay(short, title="b")], Look(size=(640, 360)))
    first, second = movie.composition.plots
    assert first.plot.limits == second.plot.limits
    assert len({view.shot.view(view.actors[0], 0).half_height for view in movie.composition.views}) == 1
    right = (slice(None), slice(320, 640))
    np.testing.assert_array_equal(movie.frame_at(2.5)[right], movie.frame_at(4.0)[right])
    assert (movie.frame_at(2.5)[:, :320] != movie.frame_at(4.0)[:, :320]).any()


def test_without_gl_the_package_to_install_is_named(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with pytest.raises(OSError, match=r"apt-get install libegl1") as error:
        film(make_episode(), size=SMALL)
    assert "\n" not in str(error.value)
