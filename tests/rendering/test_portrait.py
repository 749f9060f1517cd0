"""A portrait holds every pose of its endoscope."""

import numpy as np
import pytest

from twin.physics import headless
from twin.preset.file import load_preset
from twin.rendering.portrait import SIZE, Portrait

pytestmark = pytest.mark.skipif(headless.choose_backend() == "disable", reason=headless.HOW_TO_INSTALL)


def inked(picture):
    return picture.min(axis=2) < 200


@pytest.fixture(scope="module")
def portrait():
    return Portrait(load_preset("ureteroscope"))


@pytest.mark.parametrize("bend_deg", [-200.0, -133.0, -60.0, 0.0, 60.0, 133.0, 200.0])
def test_every_arc_is_whole_in_the_picture(portrait, bend_deg):
    picture = portrait.picture(np.full(16, np.radians(bend_deg) / 16))
    assert picture.shape == (SIZE, SIZE, 3)
    drawn = inked(picture)
    edge = np.concatenate([drawn[0], drawn[-1], drawn[:, -1]])  # the shaft comes in from the left
    assert not edge.any()
    assert drawn[:, SIZE // 3 :].any()  # ahead of the shaft


def test_opposite_bends_are_mirror_images(portrait):
    up, down = (inked(portrait.picture(np.full(16, angle))) for angle in (0.1, -0.1))
    assert (up != down[::-1]).sum() < 0.1 * up.sum()
    assert (up != down).sum() > 0.5 * up.sum()
