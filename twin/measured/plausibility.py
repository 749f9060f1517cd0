"""Plausibility of a measured log: ranges and rates that an endoscope hardly has tell of a wrong unit.

Nothing is refused here: an odd log may be a good one. What no endoscope can do is refused where it is read.
"""

from collections.abc import Sequence

import numpy as np

from twin.episode import Episode

PULL_RANGE_MM = (0.1, 100.0)
"""Usual range of a pulling distance: less is often metres given as millimetres [mm]."""
PULLEY_RANGE_DEG = (5.0, 1080.0)
"""Usual range of an angle of the pulley: less is often radians given as degrees [deg]."""
BEND_RANGE_DEG = (5.0, 540.0)
"""Usual range of a bending angle: less is often radians given as degrees [deg]."""
SAMPLE_TIMES_S = (1e-4, 2.0)
"""Usual time between two samples: more is often milliseconds given as seconds, less the reverse [s]."""
LENGTHS_S = (1.0, 86_400.0)
"""Usual length of a record [s]."""


def oddities(*logs: Episode) -> list[str]:
    """Return a warning, in one line, for each of command, angle and time that is hardly an endoscope's.

    Args:
        logs: one from `read_measured_log`, whose metadata name columns and units; or all windows from
            `read_windows`, which are judged together, as one may hardly move.
    """
    return [line for line in (_odd_command(logs), _odd_bend(logs), _odd_time(logs)) if line]


def _odd_command(logs: Sequence[Episode]) -> str | None:
    name, radius = logs[0].metadata["command_column"], logs[0].metadata["pulley_radius"]
    advice = "check `command_unit`"
    span = float(np.ptp(np.concatenate([log.pull for log in logs])))
    if radius is not None:
        odd = _outside(float(np.degrees(span / radius)), PULLEY_RANGE_DEG, "deg")
        if odd:
            return f"{name} ranges over {odd}: {advice}"
        advice += " and `pulley_radius`"
    odd = _outside(span * 1e3, PULL_RANGE_MM, "mm", " of pulling distance")
    return f"{name} ranges over {odd}: {advice}" if odd else None


def _odd_bend(logs: Sequence[Episode]) -> str | None:
    span = float(np.ptp(np.concatenate([log.truth_deg for log in logs])))
    odd = _outside(span, BEND_RANGE_DEG, "deg")
    return f"{logs[0].metadata['angle_column']} ranges over {odd}: check `angle_unit`" if odd else None


def _odd_time(logs: Sequence[Episode]) -> str | None:
    facts = logs[0].metadata
    name, is_phase = facts["time_column"], facts["seconds_per_cycle"] is not None
    advice = "check `time_unit`" + (" and `seconds_per_cycle`" if is_phase else "")
    if odd := _outside(float(np.median([log.sample_time for log in logs])), SAMPLE_TIMES_S, "s"):
        return f"{name} steps by {odd}: {advice}"
    odd = _outside(float(sum(log.time[-1] for log in logs)), LENGTHS_S, "s")
    return f"{name} ranges over {odd}: {advice}" if odd else None


def _outside(value: float, usual: tuple[float, float], unit: str, what: str = "") -> str | None:
    """Return a value out of its usual limits in words; None for one within them."""
    low, high = usual
    if low <= value <= high:
        return None
    odd = f"little (less than {low:g}" if value < low else f"much (more than {high:g}"
    return f"{value:.3g} {unit}{what}, unusually {odd} {unit})"
