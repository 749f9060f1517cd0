"""Look of a picture: camera, colours of the background, sleeve, size, resolution, and panels."""

import dataclasses

from twin.errors import InputError
from twin.physics.drawing.drawn import SLEEVES

CAMERAS = ("side", "top", "tip", "overview", "endoscopic")
PANELS = ("both", "view", "curves")
"""Contents of a picture: the endoscope next to its curves, or one of them alone."""
LEAST_SIZE = (160, 120)  # smallest width and height [pixels]


@dataclasses.dataclass(frozen=True)
class Theme:
    """Colours of a picture, `#rrggbb`, by default on white; curves differ in lightness as well."""

    paper: str = "#ffffff"  # background; on a transparent one, the colour that edges are blended with
    ink: str = "#1d232c"  # of text and reference curves
    muted: str = "#6b7480"  # of captions and numbers of axes
    trace: str = "#b3261e"  # of the bending angle and its numbers
    ghost: str = "#9aa3ae"  # of the curve of another run
    pale: str = "#d3d8de"  # of a curve that is yet to be traced
    grid: str = "#edf0f3"
    spine: str = "#c3c9d0"  # of the frame of axes
    shadow: float = 0.20  # share of light that a shadow takes away
    is_transparent: bool = False  # the paper is left out
    is_dark: bool = False  # dark parts are lit more


WHITE = Theme()
_CURVES = ("#ff7a66", "#79838f", "#414a55", "#232a33", "#47515d")
DARK = Theme("#12161c", "#e9edf2", "#9aa4b0", *_CURVES, shadow=0.55, is_dark=True)
THEMES = {"white": WHITE, "dark": DARK, "transparent": Theme(is_transparent=True)}  # by name of background


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, from 0 to 255, of `#rrggbb`."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


@dataclasses.dataclass(frozen=True)
class Look:
    """Options of a picture or a film."""

    camera: str = "side"  # one of `CAMERAS`
    background: str = "white"  # or dark, transparent
    sleeve: str = "cut"  # of the bending section; or whole, none
    panels: str = "both"  # or view, curves
    size: tuple[int, int] | None = None  # width and height [pixels]; None: what suits the kind of file
    dpi: int = 200  # pixels per inch of a picture; a film has none

    def __post_init__(self) -> None:
        valid = {"camera": CAMERAS, "background": tuple(THEMES), "sleeve": SLEEVES, "panels": PANELS}
        for name, values in valid.items():
            if getattr(self, name) not in values:
                raise InputError(f"{name} = {getattr(self, name)!r}: must be one of {', '.join(values)}")
        if not 50 <= self.dpi <= 1200:
            raise InputError(f"dpi = {self.dpi}: must be from 50 to 1200")

    @property
    def theme(self) -> Theme:
        """Colours of the background."""
        return THEMES[self.background]

    def size_within(self, usual: tuple[int, int], largest: tuple[int, int], *, even: bool) -> tuple[int, int]:
        """Return width and height [pixels], `usual` if not given, checked for a kind of file."""
        width, height = self.size or usual
        fits = LEAST_SIZE[0] <= width <= largest[0] and LEAST_SIZE[1] <= height <= largest[1]
        if not fits or (even and (width % 2 or height % 2)):
            rule = "both must be even, " if even else "must be "
            span = f"from {LEAST_SIZE[0]} x {LEAST_SIZE[1]} to {largest[0]} x {largest[1]}"
            raise InputError(f"size {width} x {height}: {rule}{span}")
        return width, height
