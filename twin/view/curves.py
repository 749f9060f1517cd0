"""Curves of a session as one SVG: the loop, the angle with its estimate over time, the tensions."""

import html
import math

import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRE_COLOURS, WIRES
from twin.view.session import Columns

Array = NDArray[np.float64]
SHOWN_S = 20.0  # over which angle and tensions are shown
LOOP_S = 60.0  # the same of the loop
MOST_POINTS = 200  # of a curve
WIDTH, LEFT, RIGHT = 320, 42, 10  # [SVG units]
INK, MUTED, ESTIMATE, BAND = "#1d232c", "#5b6673", "#7a4b00", "#f3d9a8"
COLOURS = ["#{:02x}{:02x}{:02x}".format(*(round(200 * part) for part in of)) for of in WIRE_COLOURS]
"""Of the wires, dark enough for text on white."""


class Axis:
    """Range of an axis in round steps, which only grows: a range that follows the curve would flicker."""

    def __init__(self, least: float) -> None:
        self.low, self.high = -least, least
        self.step = _round_step(2 * least / 4)

    def grow(self, values: Array) -> None:
        """Make room for values."""
        known = values[np.isfinite(values)]
        if known.size == 0:
            return
        low, high = min(self.low, float(known.min())), max(self.high, float(known.max()))
        if (low, high) != (self.low, self.high):
            self.step = _round_step((high - low) / 4)
            self.low = math.floor(low / self.step) * self.step
            self.high = math.ceil(high / self.step) * self.step

    def ticks(self) -> list[float]:
        """Return round numbers within the range."""
        first, last = math.ceil(self.low / self.step - 1e-9), math.floor(self.high / self.step + 1e-9)
        return [self.step * number for number in range(first, last + 1)]


class Curves:
    """Curves of one session; `wires` have a tension."""

    def __init__(self, planes: int, wires: int, method: str, reach_mm: float) -> None:
        self._planes, self._wires, self._method = planes, wires, method
        self._pull, self._bend, self._tension = Axis(reach_mm), Axis(20.0), Axis(1.0)
        self._tension.low = 0.0

    def svg(self, trail: Array) -> str:
        """Return the drawing of a trail; its last sample is the present."""
        now = float(trail[-1, Columns.TIME_S])
        begin = max(now - SHOWN_S, 0.0)
        loop, recent = (
            _thin(trail[np.searchsorted(trail[:, Columns.TIME_S], now - seconds) :])
            for seconds in (LOOP_S, SHOWN_S)
        )
        pulls, bends = (
            [Columns.PULL_MM, Columns.LATERAL_PULL_MM],
            [Columns.BEND_DEG, Columns.LATERAL_BEND_DEG],
        )
        pulls, bends = pulls[: self._planes], bends[: self._planes]
        self._pull.grow(loop[:, pulls])
        self._bend.grow(loop[:, [*bends, Columns.ESTIMATE_DEG]])
        self._tension.grow(recent[:, Columns.TENSIONS_N :])
        time = Axis(1.0)
        time.low, time.high, time.step = begin, max(begin + SHOWN_S, now), 5.0
        panels = [
            self._loop(_Panel(22, 150, self._pull, self._bend), loop, pulls, bends),
            self._angle(_Panel(228, 100, time, self._bend), recent, bends),
        ]
        height = 228 + 100 + 34
        if self._wires:
            panels.append(self._tensions(_Panel(height + 22, 100, time, self._tension), recent))
            height += 22 + 100 + 24
        now_deg = trail[-1, Columns.BEND_DEG]
        label = html.escape(f"Loop, angle and tensions over time; the bend is {now_deg:.1f} deg now.")
        return (
            f'<svg role="img" aria-label="{label}" viewBox="0 0 {WIDTH} {height}" '
            f'style="display:block;width:calc(100% - 1em);margin:0.5em" '
            f'font-family="sans-serif" font-size="12" fill="{INK}">'
            f"{''.join(panels)}</svg>"
        )

    def _loop(self, panel: "_Panel", trail: Array, pulls: list[Columns], bends: list[Columns]) -> str:
        names = [("plane a-b", INK), ("plane c-d", COLOURS[2])][: len(pulls)] if len(pulls) > 1 else []
        parts = [panel.frame("Loop: bend [deg] against pull [mm]", names)]
        for pull, bend, colour in zip(pulls, bends, (INK, COLOURS[2]), strict=False):
            parts += [panel.line(trail[:, pull], trail[:, bend], colour)]
            parts += [panel.dot(trail[-1, pull], trail[-1, bend], colour)]
        return "".join(parts)

    def _angle(self, panel: "_Panel", trail: Array, bends: list[Columns]) -> str:
        time, low, high = (trail[:, of] for of in (Columns.TIME_S, Columns.LOW_DEG, Columns.HIGH_DEG))
        names = [("tip", INK)]
        names += [(f"{self._method}, 95 %", ESTIMATE)] if self._method else []
        names += [("readings", MUTED)] if np.isfinite(trail[:, Columns.MEASURED_DEG]).any() else []
        parts = [panel.frame("Bend [deg]", names)]
        known = np.isfinite(low + high)
        if known.any():
            edge = np.concatenate([low[known], high[known][::-1]])
            parts.append(panel.area(np.concatenate([time[known], time[known][::-1]]), edge, BAND))
        parts.append(panel.dots(time, trail[:, Columns.MEASURED_DEG], MUTED))
        for bend, colour in zip(bends, (INK, COLOURS[2]), strict=False):
            parts.append(panel.line(time, trail[:, bend], colour))
        return "".join([*parts, panel.line(time, trail[:, Columns.ESTIMATE_DEG], ESTIMATE)])

    def _tensions(self, panel: "_Panel", trail: Array) -> str:
        names = [(f"wire {WIRES[wire]}", COLOURS[wire]) for wire in range(self._wires)]
        parts = [panel.frame("Tension [N]: pulley, dashed: tip", names)]
        for end, dashes in enumerate(("", ' stroke-dasharray="4 3"')):
            for wire in range(self._wires):
                tension = trail[:, Columns.TENSIONS_N + end * self._wires + wire]
                parts.append(panel.line(trail[:, Columns.TIME_S], tension, COLOURS[wire], dashes))
        return "".join(parts)


class _Panel:
    """One pair of axes; everything is drawn within them."""

    def __init__(self, top: float, height: float, x: Axis, y: Axis) -> None:
        self._top, self._height, self._x, self._y = top, height, x, y

    def _places(self, x: Array, y: Array) -> list[str]:
        across = LEFT + (x - self._x.low) / (self._x.high - self._x.low) * (WIDTH - LEFT - RIGHT)
        share = np.clip((y - self._y.low) / (self._y.high - self._y.low), 0.0, 1.0)
        down = self._top + (1 - share) * self._height
        known = np.isfinite(across + down)
        pairs = zip(across[known].tolist(), down[known].tolist(), strict=True)
        return [f"{a:.1f},{b:.1f}" for a, b in pairs]

    def frame(self, title: str, names: list[tuple[str, str]]) -> str:
        """Return grid, numbers, title, and names by colour."""
        bottom, parts = self._top + self._height, []
        for tick in self._x.ticks():
            (place,) = self._places(np.array([tick]), np.array([self._y.low]))
            x = place.split(",")[0]
            parts.append(f'<path d="M{x} {self._top}V{bottom}" stroke="#e1e5ea"/>')
            parts.append(f'<text x="{x}" y="{bottom + 14}" text-anchor="middle">{_number(tick)}</text>')
        for tick in self._y.ticks():
            (place,) = self._places(np.array([self._x.low]), np.array([tick]))
            y = float(place.split(",")[1])
            parts.append(f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="#e1e5ea"/>')
            parts.append(f'<text x="{LEFT - 5}" y="{y + 4}" text-anchor="end">{_number(tick)}</text>')
        shown = "".join(
            f'<tspan dx="8" fill="{colour}">{html.escape(name)}</tspan>' for name, colour in names
        )
        title = f'<tspan font-weight="bold">{html.escape(title)}</tspan>{shown}'
        return "".join([*parts, f'<text x="4" y="{self._top - 10}">{title}</text>'])

    def line(self, x: Array, y: Array, colour: str, more: str = "") -> str:
        """Return a curve."""
        points = " ".join(self._places(x, y))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"{more}/>'

    def area(self, x: Array, y: Array, colour: str) -> str:
        """Return a filled polygon."""
        return f'<polygon points="{" ".join(self._places(x, y))}" fill="{colour}"/>'

    def dots(self, x: Array, y: Array, colour: str) -> str:
        """Return small dots."""
        path = "".join(f"M{place}h0" for place in self._places(x, y))
        return f'<path d="{path}" stroke="{colour}" stroke-width="2.4" stroke-linecap="round"/>'

    def dot(self, x: float, y: float, colour: str) -> str:
        """Return the dot of the present."""
        return "".join(
            '<circle cx="{}" cy="{}" r="4" fill="{}"/>'.format(*place.split(","), colour)
            for place in self._places(np.array([x]), np.array([y]))
        )


def _thin(trail: Array) -> Array:
    """Return at most about `MOST_POINTS` samples, always at the same times, and the last."""
    stride = 1 << max(math.ceil(math.log2(len(trail) / MOST_POINTS)), 0)
    return np.vstack([trail[:-1:stride], trail[-1:]])


def _round_step(step: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at least as large."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(of * power for of in (1, 2, 5, 10) if of * power >= step * (1 - 1e-9))


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
