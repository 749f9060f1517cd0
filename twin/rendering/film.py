"""Frames of a film: views and plots of a composition, drawn into pixels sample by sample."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from twin.rendering.composition import Composition, Record, sample_at
from twin.rendering.layers import Picture, on_paper
from twin.rendering.look import Look
from twin.rendering.marks import Label, paint
from twin.rendering.numbers import times_real
from twin.rendering.theme import rgb
from twin.rendering.trace_panel import TracePanel

WIDTH, HEIGHT = 1280, 720
LARGEST = (3840, 2160)
"""Largest width and height of a frame [pixels]."""
_DPI = 100  # text of a film is measured by its pixels


class Film:
    """Renderer of the frames of a composition; each frame is drawn on demand."""

    def __init__(
        self, records: Sequence[Record], look: Look | None = None, speed: float | None = None
    ) -> None:
        """Draw the static parts.

        Args:
            records: what is shown, side by side.
            look: options; both sides of its size must be even.
            speed: seconds of the record per second of the film, which the film says; None: it does not.

        Raises:
            ValueError: a size is odd or out of range, the background is transparent, or what is beside a
                record is not at its times.
            OSError: nothing on this system can draw without a screen.
        """
        look = look or Look()
        self.width, self.height = look.size_within((WIDTH, HEIGHT), LARGEST, even=True)
        self._theme = look.theme
        self.composition = Composition(records, look, self.width, self.height, dpi=_DPI)
        self._panels = [
            TracePanel(cell.plot, cell.box.width, cell.box.height, self._theme)
            for cell in self.composition.plots
        ]
        self._speed = "" if speed is None else times_real(speed)

    @property
    def seconds(self) -> float:
        """Length of the longest record [s]."""
        return max(float(one.episode.time[-1] - one.episode.time[0]) for one in self.composition.records)

    def frame_at(self, time: float) -> Picture:
        """Return the frame at a time since the start of the records [s]; one that has ended stands still."""
        return self._drawn([sample_at(record.episode, time) for record in self.composition.records])

    def frame(self, index: int) -> Picture:
        """Return the frame of sample `index` of every record, (height, width, 3)."""
        return self._drawn([index] * len(self.composition.records))

    def _drawn(self, samples: Sequence[int]) -> Picture:
        frame = np.empty((self.height, self.width, 3), dtype=np.uint8)
        frame[:] = rgb(self._theme.paper)
        for cell in self.composition.views:
            picture = Image.fromarray(on_paper(cell.scene(samples[cell.number]), self._theme))
            paint(picture, cell.marks(samples[cell.number]))
            _put(frame, cell.box, np.asarray(picture))
        for plotted, panel in zip(self.composition.plots, self._panels, strict=True):
            _put(frame, plotted.box, panel.draw(samples[plotted.record]))
        return self._with_speed(frame) if self._speed else frame

    def _with_speed(self, frame: Picture) -> Picture:
        """Write how fast the film goes into its upper right corner, or that of its view."""
        box = self.composition.views[-1].box if self.composition.views else self.composition.plots[-1].box
        if len(self.composition.records) == 1 and self.composition.views:
            box = self.composition.views[0].box
        unit = self.composition.scale_of(box) * _DPI / 100
        right = box.left + box.width - 24 * unit
        picture = Image.fromarray(frame)
        paint(picture, [Label(right, 46 * unit, self._speed, self._theme.muted, 17 * unit, anchor="rs")])
        return np.asarray(picture)


def _put(frame: NDArray[np.uint8], box: tuple[int, int, int, int], picture: Picture) -> None:
    left, top, width, height = box
    frame[top : top + height, left : left + width] = picture
