"""Named fidelities: how finely a preset is divided in space and time, and what that costs in accuracy.

Errors are those of the bending angle of both built-in presets in the MuJoCo twin, over records of all kinds
of signals (`twin/benchmark/fidelity.py`), against sheaths of 20 elements at an eighth of the default step.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

from twin.errors import InputError
from twin.files.shown import shown
from twin.preset.preset import Preset, suggestion


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Numbers of parts and steps, with the error that they leave.

    Attributes:
        changes: parameters of a preset by name; the others stay.
        rms_deg: RMS error of the bend over a record, at most [deg].
        most_deg: error of the bend at any time, at most [deg].
    """

    changes: Mapping[str, Any]
    rms_deg: float
    most_deg: float


FIDELITIES = {
    "fine": Fidelity({"sheath_elements": 10, "time_step": 1.25e-3}, 0.1, 0.3),
    "standard": Fidelity({}, 0.3, 0.8),
    "fast": Fidelity({"vertebrae": 8, "time_step": 5e-3}, 0.3, 0.9),
}
"""Each fidelity by its name, from the finest; `standard` is the preset as it stands."""


def at_fidelity(preset: Preset, fidelity: str) -> Preset:
    """Return a preset at a named fidelity: the same endoscope, divided more finely or more coarsely.

    Args:
        preset: the endoscope.
        fidelity: one of `FIDELITIES`.

    Raises:
        ValueError: there is no such fidelity, or its time step does not divide the preset's control period.
    """
    if fidelity not in FIDELITIES:
        raise InputError(f"unknown fidelity {shown(fidelity)}{suggestion(fidelity, list(FIDELITIES))}")
    try:
        return preset.replace(**FIDELITIES[fidelity].changes)
    except InputError as error:
        raise InputError(f"fidelity {fidelity} of {preset.name!r}: {error}") from error
