"""Another run is drawn as a pale ghost below the first, and the reference over time."""

import dataclasses

import numpy as np
import pytest
from PIL import Image
from rendered import SMALL, UP, film, ink, make_episode, needs_gl

from twin.episode import Episode
from twin.hysteresis import ColemanHodgdon
from twin.rendering.composition import GHOST_INK
from twin.rendering.look import WHITE, Look
from twin.rendering.overlay import Overlay, with_command, with_model
from twin.rendering.picture import on_paper
from twin.rendering.plots import TracePanel, loop
from twin.rendering.render import render

EPISODE, GHOST = make_episode(), make_episode(amplitude_deg=-30)
REFERENCE_DEG = np.full(41, 60.0)
BOTH = Overlay(EPISODE, GHOST, REFERENCE_DEG)


def view_of(overlay: Overlay, size: tuple[int, int] = SMALL):
    return film(overlay, size=size).composition.views[0]


def around(view, picture: np.ndarray, actor: int) -> np.ndarray:
    """The pixels about a tip."""
    column, row = (round(value) for value in view.tip(UP, actor))
    return picture[row - 4 : row + 5, column - 4 : column + 5]


@needs_gl
def test_the_ghost_stands_where_its_own_bend_puts_it_and_is_paler():
    view = view_of(BOTH)
    scene, alone = (on_paper(layer, WHITE) for layer in (view.scene(UP), view.pose(UP)))
    straight = view.tip(0)[1]
    assert view.tip(UP, 1)[1] > straight > view.tip(UP)[1]  # one is bent up, the other down
    solid, ghost = (ink(around(view, scene, actor)).max() for actor in (0, 1))
    assert ink(around(view, alone, 1)).max() < 5
    assert solid > 200
    assert ghost < 0.6 * solid
    assert 0.8 * GHOST_INK * solid < ghost


@needs_gl
def test_the_view_holds_both_poses():
    view = view_of(Overlay(make_episode(amplitude_deg=5), make_episode(amplitude_deg=-110)), (640, 180))
    for index in range(41):
        column, row = view.tip(index, 1)
        assert 4 < column < view.box.width - 4
        assert 4 < row < view.box.height - 4


@pytest.mark.parametrize(
    ("ghost", "found"),
    [
        (dataclasses.replace(GHOST, time=GHOST.time * 2), "41 samples from 0 to 8 s"),
        (GHOST.resampled(0.2), "21 samples from 0 to 4 s"),
    ],
)
def test_a_ghost_at_other_times_is_refused_in_one_line(tmp_path, ghost: Episode, found: str):
    wanted = f"^ghost has {found}: must be at the times of the record, 41 samples from 0 to 4 s$"
    for name in ("bend.png", "bend.mp4"):
        with pytest.raises(ValueError, match=wanted):
            render(Overlay(EPISODE, ghost), tmp_path / name)
    assert not any(tmp_path.iterdir())


def dark_columns(picture: np.ndarray) -> int:
    """How many columns of a row hold ink of the reference, in the row that has most."""
    return int((picture.max(axis=-1) < 90)[60:-60, 80:-30].sum(axis=1).max())


def test_the_trace_grows_and_shrinks_with_the_sample():
    """A panel keeps what it has drawn: one that goes back is as one that was never further."""
    plot = loop(Overlay(EPISODE), WHITE)
    panel, fresh = TracePanel(plot, 320, 240), TracePanel(plot, 320, 240)
    inked = [(np.ptp(panel.draw(index).astype(int), axis=-1) > 80).sum() for index in (2, 20, 40)]
    assert inked[0] < inked[1] < inked[2]
    np.testing.assert_array_equal(panel.draw(20), fresh.draw(20))


@needs_gl
@pytest.mark.parametrize("reference_deg", [REFERENCE_DEG, np.empty(0)])
def test_a_picture_shows_both_poses_and_both_curves(tmp_path, reference_deg):
    look = Look(size=(900, 410), dpi=100)
    path = render(Overlay(EPISODE, GHOST, reference_deg), tmp_path / "bend.png", look=look)
    picture = np.asarray(Image.open(path))[..., :3]
    red, green, blue = np.moveaxis(picture[50:, 505:].astype(int), -1, 0)
    assert (red - green > 80).sum() > 200
    assert ((abs(red - blue) < 30) & (red > 120) & (red < 180)).sum() > 200
    assert (dark_columns(picture[:, 505:]) > 100) == (len(reference_deg) > 0)


def test_the_ghost_of_a_model_has_the_response_of_the_model():
    model = ColemanHodgdon(1.15, 22.0, 9.0)
    overlay = with_model(EPISODE, model, "Coleman-Hodgdon")
    wanted = model.response(EPISODE.pull_mm, EPISODE.truth_deg[0])
    np.testing.assert_allclose(overlay.ghost.truth_deg, wanted)
    np.testing.assert_allclose(overlay.ghost.joint_angle.sum(axis=1), np.radians(wanted))
    off = np.sqrt(np.mean((wanted - EPISODE.truth_deg) ** 2))
    assert overlay.ghost_name == f"Coleman-Hodgdon, RMSE {off:.2f}°"
    assert overlay.short_name == "Coleman-Hodgdon"


def test_the_commanded_ghost_is_the_reference_or_the_straight_line():
    overlay = with_command(EPISODE, np.empty(0))
    slope = np.diff(overlay.ghost.truth_deg) / np.diff(EPISODE.pull_mm)
    np.testing.assert_allclose(slope, slope[0])
    left = EPISODE.truth_deg - overlay.ghost.truth_deg
    assert abs(left.mean()) < 1e-9
    assert abs(left @ EPISODE.pull_mm) < 1e-6  # the normal equations of least squares
    half = np.where(EPISODE.time < 2, np.nan, 60.0)
    known = with_command(EPISODE, half)
    np.testing.assert_allclose(known.ghost.truth_deg, np.where(EPISODE.time < 2, EPISODE.truth_deg, 60.0))
    assert known.has_reference
