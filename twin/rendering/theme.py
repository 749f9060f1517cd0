"""Backgrounds of pictures, and the colours that are read on them."""

import dataclasses

from twin.errors import InputError


@dataclasses.dataclass(frozen=True)
class Theme:
    """Colours of a picture, `#rrggbb`; every pair of curves differs in lightness as well.

    Attributes:
        paper: background; on a transparent one, what edges are blended with where there must be a colour.
        ink: of text and reference curves.
        muted: of captions and numbers of axes.
        trace: of the bending angle, and all that is about it.
        ghost: of the curve that another run left.
        pale: of a curve that is yet to be traced.
        grid: of the lines of axes.
        spine: of the frame of axes.
        shadow: share of light that a shadow takes away.
        is_transparent: True where the paper is left out.
        is_dark: True where the paper is dark, so that dark parts are lit more.
    """

    paper: str
    ink: str
    muted: str
    trace: str
    ghost: str
    pale: str
    grid: str
    spine: str
    shadow: float
    is_transparent: bool = False
    is_dark: bool = False


WHITE = Theme(
    paper="#ffffff",
    ink="#1d232c",
    muted="#6b7480",
    trace="#b3261e",
    ghost="#9aa3ae",
    pale="#d3d8de",
    grid="#edf0f3",
    spine="#c3c9d0",
    shadow=0.20,
)
DARK = Theme(
    paper="#12161c",
    ink="#e9edf2",
    muted="#9aa4b0",
    trace="#ff7a66",
    ghost="#79838f",
    pale="#414a55",
    grid="#232a33",
    spine="#47515d",
    shadow=0.55,
    is_dark=True,
)
THEMES = {"white": WHITE, "dark": DARK, "transparent": dataclasses.replace(WHITE, is_transparent=True)}
"""Themes by the name of their background."""


def theme(background: str) -> Theme:
    """Return the theme of a background.

    Raises:
        ValueError: there is no such background.
    """
    if background not in THEMES:
        raise InputError(f"background = {background!r}: must be one of {', '.join(THEMES)}")
    return THEMES[background]


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, from 0 to 255, of `#rrggbb`."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
