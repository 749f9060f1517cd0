"""Layers cover one another as light does; numbers, colours and marks are as stated."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from twin.rendering.actor import TensionColours
from twin.rendering.look import THEMES, rgb
from twin.rendering.picture import Badge, Bar, Label, Rule, over, paint, signed, straight

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"


def random_layer(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    alpha = rng.integers(0, 256, (7, 9, 1))
    return np.concatenate([rng.uniform(size=(7, 9, 3)) * alpha, alpha], axis=-1).astype(np.uint8)


@given(st.integers(0, 50), st.integers(51, 100))
def test_over_is_the_rule_of_porter_and_duff(one, other):
    front, behind = random_layer(one), random_layer(other)
    wanted = front + behind * (1 - front[..., 3:] / 255.0)
    assert np.abs(over(front, behind) - wanted).max() <= 1


@given(st.integers(0, 100))
def test_straight_colours_times_alpha_are_the_layer(seed):
    layer = random_layer(seed)
    back = straight(layer)
    np.testing.assert_array_equal(back[..., 3], layer[..., 3])
    assert np.abs(back[..., :3] * (layer[..., 3:] / 255.0) - layer[..., :3]).max() <= 1


@given(st.floats(-400, 400), st.integers(0, 2))
def test_a_number_has_its_sign_and_a_zero_has_none(value, digits):
    text = signed(value, digits)
    assert "-" not in text
    number = float(text.replace(MINUS, "-"))
    assert number == pytest.approx(value, abs=0.5 * 10**-digits + 1e-9)
    assert (text[0] in f"+{MINUS}") == (number != 0)


def test_more_tension_is_lighter_also_in_greyscale():
    colours = TensionColours(40.0)
    red, green, blue = np.moveaxis(colours(np.linspace(0, 40, 50)), -1, 0)
    lightness = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    assert (np.diff(lightness) > 0).all()
    np.testing.assert_array_equal(colours(np.array([-1.0, 90.0])), colours(np.array([0.0, 40.0])))


@pytest.mark.parametrize("theme", THEMES.values(), ids=list(THEMES))
def test_text_is_read_on_its_paper(theme):
    """Contrast of the Web Content Accessibility Guidelines 2.1: 4.5 for text."""

    def luminance(colour: str) -> float:
        parts = np.array(rgb(colour)) / 255
        linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    for colour in (theme.ink, theme.muted, theme.trace):
        light, dark = sorted([luminance(colour), luminance(theme.paper)], reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 4.5, colour


def test_marks_are_painted_at_their_places():
    picture = Image.new("RGB", (200, 100), "white")
    colours = np.stack([np.linspace(0, 1, 8)] * 3, axis=-1)
    paint(
        picture,
        [
            Rule(((10, 20), (60, 20)), "#ff0000", 3),
            Bar(100, 50, 80, 10, colours),
            Badge(30, 70, "1", "#0000ff", 12),
            Label(150, 30, "x", "#000000", 20, anchor="mm"),
        ],
    )
    pixels = np.asarray(picture).astype(int)
    assert tuple(pixels[20, 35]) == (255, 0, 0)
    assert pixels[55, 101].max() < 40 < 215 < pixels[55, 178].min()
    assert (pixels[60:80, 20:40] == [0, 0, 255]).all(axis=-1).sum() > 60
    assert pixels[20:40, 140:160].min() < 60
