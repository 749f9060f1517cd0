"""Reading and checking the parameters of a hysteresis model from its file."""

from collections.abc import Sequence
from typing import Any

from twin.errors import InputError
from twin.files.shown import shown

LARGEST = 1e9  # magnitude of a parameter that no endoscope comes near, in any of the units
MOST_ENTRIES = 1000


def numbers(values: dict[str, Any], names: Sequence[str]) -> list[float]:
    """Return the named values, each a single number; raises `ValueError` for another or a missing one."""
    found = [values.get(name) for name in names]
    for name, value in zip(names, found, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float):
            fault = "is missing" if name not in values else f"is {shown(value)}, no number"
            raise InputError(f"{name} {fault}; it needs {', '.join(names)}")
        if not abs(value) <= LARGEST:
            raise InputError(f"{name} is {shown(value)}: must be finite, at most {LARGEST:g}")
    return [float(value) for value in found if value is not None]


def series(values: dict[str, Any], name: str) -> tuple[float, ...]:
    """Return a named list of finite numbers; raises `ValueError` for anything else."""
    found = values.get(name)
    if not isinstance(found, list | tuple) or not found:
        raise InputError(f"{name} is {shown(found)}: must be a list of numbers")
    if len(found) > MOST_ENTRIES:
        raise InputError(f"{name} has {len(found)} entries: at most {MOST_ENTRIES}")
    plain = all(isinstance(value, int | float) and not isinstance(value, bool) for value in found)
    if not plain or not all(abs(value) <= LARGEST for value in found):
        raise InputError(
            f"{name} is {shown(found)}: every entry must be a finite number, at most {LARGEST:g}"
        )
    return tuple(float(value) for value in found)
