"""Look of a picture: camera, background, sleeve, size and resolution, and what is left out."""

import dataclasses

from twin.errors import InputError
from twin.physics.drawing.parts import SLEEVES
from twin.rendering.cameras import check_camera
from twin.rendering.theme import Theme, theme

PANELS = ("both", "view", "curves")
"""Contents of a picture: the endoscope beside its curves, or one of them alone."""
LEAST_SIZE = (160, 120)
"""Smallest width and height [pixels]."""


@dataclasses.dataclass(frozen=True)
class Look:
    """Options of a picture or a film.

    Attributes:
        camera: one of `twin.rendering.cameras.CAMERAS`.
        background: white, dark or transparent.
        sleeve: of the bending section: cut, whole or none.
        panels: both, view or curves.
        size: width and height [pixels]; None: what suits the kind of file.
        dpi: pixels per inch of a picture; a film has none.
    """

    camera: str = "side"
    background: str = "white"
    sleeve: str = "cut"
    panels: str = "both"
    size: tuple[int, int] | None = None
    dpi: int = 200

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            ValueError: a name is unknown, or a number is out of range.
        """
        check_camera(self.camera)
        theme(self.background)
        if self.sleeve not in SLEEVES:
            raise InputError(f"sleeve = {self.sleeve!r}: must be one of {', '.join(SLEEVES)}")
        if self.panels not in PANELS:
            raise InputError(f"panels = {self.panels!r}: must be one of {', '.join(PANELS)}")
        if not 50 <= self.dpi <= 1200:
            raise InputError(f"dpi = {self.dpi}: must be from 50 to 1200")

    @property
    def theme(self) -> Theme:
        """Colours of the background."""
        return theme(self.background)

    def size_within(self, usual: tuple[int, int], largest: tuple[int, int], *, even: bool) -> tuple[int, int]:
        """Return width and height [pixels], checked for a kind of file.

        Args:
            usual: where none is asked for.
            largest: that the kind of file can be.
            even: whether both must be even.

        Raises:
            ValueError: the size is out of range.
        """
        width, height = self.size or usual
        fits = LEAST_SIZE[0] <= width <= largest[0] and LEAST_SIZE[1] <= height <= largest[1]
        if not fits or (even and (width % 2 or height % 2)):
            rule = "both must be even, " if even else "must be "
            span = f"from {LEAST_SIZE[0]} x {LEAST_SIZE[1]} to {largest[0]} x {largest[1]}"
            raise InputError(f"size {width} x {height}: {rule}{span}")
        return width, height
