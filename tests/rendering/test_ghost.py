"""A second run is drawn as a pale ghost behind the first, and the angle that was wanted beside both."""

import dataclasses

import numpy as np
import pytest
from PIL import Image
from rendered import SMALL, UP, make_episode, needs_gl

from twin.episode import Episode
from twin.rendering.beside import Beside
from twin.rendering.film import GHOST_INK, Film
from twin.rendering.loop_panel import LoopPanel
from twin.rendering.render import render
from twin.rendering.still import farthest_sample
from twin.rendering.time_panel import TimePanel

EPISODE, GHOST = make_episode(), make_episode(amplitude_deg=-30)
REFERENCE_DEG = np.full(41, 60.0)
BOTH = Beside(GHOST, REFERENCE_DEG)


def ink(picture: np.ndarray) -> np.ndarray:
    return 255 - picture.astype(float).min(axis=-1)


def around(film: Film, picture: np.ndarray, actor: int) -> np.ndarray:
    """The pixels about a tip."""
    column, row = (round(value) for value in film.tip(UP, actor))
    return picture[row - 4 : row + 5, column - 4 : column + 5]


@needs_gl
def test_the_ghost_stands_where_its_own_bend_puts_it_and_is_paler():
    film = Film(EPISODE, **SMALL, beside=BOTH)
    scene, alone = film.scene(UP), film.pose(UP)
    assert film.tip(UP, 1)[1] > film.height / 2 > film.tip(UP)[1]  # one is bent up, the other down
    solid, ghost = (ink(around(film, scene, actor)).max() for actor in (0, 1))
    assert ink(around(film, alone, 1)).max() < 5
    assert solid > 200
    assert ghost < 0.5 * solid
    assert 0.8 * GHOST_INK * solid < ghost < 1.2 * GHOST_INK * solid


@needs_gl
def test_the_solid_pose_is_unchanged_by_the_ghost():
    film = Film(EPISODE, **SMALL, beside=BOTH)
    scene, alone = film.scene(UP), film.pose(UP)
    dark = ink(alone) > 25
    assert dark.sum() > 200
    np.testing.assert_array_equal(scene[dark], alone[dark])
    np.testing.assert_array_equal(Film(EPISODE, **SMALL).scene(UP), Film(EPISODE, **SMALL).pose(UP))


@needs_gl
def test_the_view_holds_both_poses():
    wide = Beside(make_episode(amplitude_deg=-110))
    still = make_episode(amplitude_deg=5)
    film = Film(still, width=640, height=180, beside=wide)
    for index in range(41):
        column, row = film.tip(index, 1)
        assert 4 < column < film.width / 2 - 4
        assert 4 < row < film.height - 4


@needs_gl
def test_the_numbers_tell_the_angle_of_the_ghost():
    """By comparison: the numbers are pixels by then."""
    size = {"width": 1280, "height": 720}
    line = (slice(160, 195), slice(30, 300))
    without, one, other = (
        Film(EPISODE, **size, beside=Beside(ghost)).frame(UP)[line]
        for ghost in (None, GHOST, make_episode(amplitude_deg=-31))
    )
    assert ink(without).max() < 5 < 80 < ink(one).max()
    assert (one != other).any()


@pytest.mark.parametrize(
    ("ghost", "found"),
    [
        (dataclasses.replace(GHOST, time=GHOST.time * 2), "41 samples from 0 to 8 s"),
        (GHOST.every(0.2), "21 samples from 0 to 4 s"),
    ],
)
@needs_gl
def test_a_ghost_at_other_times_is_refused_in_one_line(tmp_path, ghost: Episode, found: str):
    wanted = f"^ghost has {found}: must be at the times of the record, 41 samples from 0 to 4 s$"
    for name in ("bend.png", "bend.mp4"):
        with pytest.raises(ValueError, match=wanted):
            render(EPISODE, tmp_path / name, **SMALL, beside=Beside(ghost))
    assert not any(tmp_path.iterdir())


@needs_gl
def test_a_reference_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"^reference has 40 samples, the record has 41$"):
        Film(EPISODE, **SMALL, beside=Beside(reference_deg=REFERENCE_DEG[1:]))


def dark_columns(picture: np.ndarray) -> int:
    """How many columns of a row hold ink of the reference, in the row that has most."""
    return int((picture.max(axis=-1) < 90)[60:-60, 70:-30].sum(axis=1).max())


def test_the_reference_is_drawn_over_time_and_only_where_it_is_known():
    size = (640, 480)
    known, half, none = (
        TimePanel(EPISODE, *size, Beside(GHOST, reference_deg)).draw(0)
        for reference_deg in (REFERENCE_DEG, np.where(EPISODE.time < 2, np.nan, 60), np.full(41, np.nan))
    )
    assert dark_columns(none) < 10
    assert dark_columns(known) > 200
    assert 0.4 < dark_columns(half) / dark_columns(known) < 0.6


def test_the_trace_over_time_ends_at_the_sample():
    panel = TimePanel(EPISODE, 640, 480, BOTH)
    columns = []
    for index in (10, 20, 40):
        picture = panel.draw(index).astype(int)[60:]  # below the legend
        columns.append(np.flatnonzero((picture[..., 0] - picture[..., 1] > 80).any(axis=0)).max())
    assert columns[1] - columns[0] == pytest.approx((columns[2] - columns[1]) / 2, abs=3)


def test_the_loop_of_the_ghost_is_seen_and_no_legend_without_one():
    size = (640, 480)
    alone, both = (LoopPanel(EPISODE, *size, beside).draw(0) for beside in (Beside(), Beside(GHOST)))
    assert ink(alone)[:40].max() < 5
    assert ink(both)[:40].max() > 80
    grey = [(ink(picture)[60:] > 80).sum() for picture in (alone, both)]
    assert grey[1] > grey[0] + 200


@needs_gl
def test_a_name_out_of_a_file_is_written_as_it_is_or_left_out():
    for name in (r"$\nothing$", "x" * 100, "two\nlines", 7, None):
        named = dataclasses.replace(GHOST, metadata={"controller": name})
        Film(named, **SMALL, beside=Beside(named, REFERENCE_DEG)).frame(0)


def test_the_farthest_sample_is_where_the_bends_differ_most():
    late = np.where(np.arange(41) == 33, -np.radians(240), GHOST.bend)
    assert farthest_sample(EPISODE, GHOST) in (10, 30)  # the crests of both
    assert farthest_sample(EPISODE, dataclasses.replace(GHOST, bend=late)) == 33
    assert farthest_sample(EPISODE, dataclasses.replace(GHOST, bend=-late)) == 33


@needs_gl
@pytest.mark.parametrize("reference_deg", [REFERENCE_DEG, np.empty(0)])
def test_a_picture_shows_both_poses_and_both_curves(tmp_path, reference_deg):
    path = render(EPISODE, tmp_path / "bend.png", beside=Beside(GHOST, reference_deg))
    picture = np.asarray(Image.open(path))[..., :3]
    assert picture.shape[:2] == (820, 1800)
    solid, ghost = (half[:, 300:810] for half in (picture[:390], picture[430:]))
    if farthest_sample(EPISODE, GHOST) == 30:  # the crest downwards
        solid, ghost = ghost, solid
    assert ink(solid).max() > 200
    assert 40 < ink(ghost).max() < 1.5 * GHOST_INK * 255
    red, green, blue = np.moveaxis(picture[100:, 1010:].astype(int), -1, 0)
    assert (red - green > 80).sum() > 500
    assert ((abs(red - blue) < 30) & (red > 120) & (red < 180)).sum() > 500
    assert (dark_columns(picture[:, 1010:]) > 300) == (len(reference_deg) > 0)


@needs_gl
def test_a_picture_without_a_ghost_is_the_same_with_a_reference(tmp_path):
    paths = [
        render(EPISODE, tmp_path / f"{number}.png", beside=beside)
        for number, beside in enumerate((Beside(), Beside(reference_deg=REFERENCE_DEG)))
    ]
    assert paths[0].read_bytes() == paths[1].read_bytes()
