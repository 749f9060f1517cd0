"""Farthest pull that is simulated: where the section would be bent by two full turns.

The wires are elastic: the moment that the section needs stretches the wire that pulls. A pull far beyond is
in another unit, micrometres given as millimetres or millimetres as metres.
"""

import numpy as np

from twin.errors import InputError
from twin.mechanics.wire import quadratic_stiffness, segment_stiffness, stretch_at, wound_tension
from twin.preset.preset import Preset
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM


def farthest_pull(preset: Preset) -> float:
    """Return the magnitude of the farthest pulling distance that is simulated [m].

    It bends the section by `LARGEST_BEND_DEG` without friction, the other wire slack, and is at most
    `LARGEST_PULL_MM`. Friction only lessens the bend.
    """
    bend = np.radians(LARGEST_BEND_DEG)
    moment = preset.section_stiffness * bend * (1 + preset.section_stiffening * bend**2)
    springs = segment_stiffness(preset), quadratic_stiffness(preset)
    # All segments in series carry the tension; the stretch by winding up is there already.
    stretch = (preset.sheath_elements + 1) * float(
        stretch_at(np.array(moment / preset.wire_offset), *springs)
    )
    wound = float(stretch_at(wound_tension(preset), *springs).sum())
    return float(min(preset.wire_offset * bend + max(stretch - wound, 0.0), LARGEST_PULL_MM * 1e-3))


def check_reached(preset: Preset, stroke_mm: tuple[float, float]) -> None:
    """Refuse a stroke that goes beyond the farthest pulling distance, or an end of which is no number."""
    farthest_mm = farthest_pull(preset) * 1e3
    if not np.isfinite(stroke_mm).all() or max(map(abs, stroke_mm)) > farthest_mm:
        most = f"this endoscope is pulled by at most {farthest_mm:.3g} mm"
        raise InputError(f"stroke [{stroke_mm[0]:g}, {stroke_mm[1]:g}] mm: {most}: is the unit right?")
