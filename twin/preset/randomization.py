"""Domain randomisation: presets drawn from the `ranges` of a preset file."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.shown import cut, shown
from twin.preset.file import read_preset_file
from twin.preset.preset import Preset, parameter_limits

WIDE = 2.0  # ratio of the ends of a range that is drawn log-uniformly: 1 to 2 as often as 2 to 4

NEVER_DRAWN = (
    *(field.name for field in dataclasses.fields(Preset) if isinstance(field.default, int)),
    "time_step",
    "control_period",
)
"""Parameters that are chosen and not drawn: numbers of parts, and times of the solver."""


@dataclasses.dataclass(frozen=True)
class Ranges:
    """Ranges of the randomised parameters; every other parameter stays as the preset has it."""

    limits: tuple[tuple[str, float, float], ...]
    """Name, lowest and highest value of each parameter, in SI units."""

    def __post_init__(self) -> None:
        """Check that every range lies within the limits of its parameter."""
        # 5 and 5.0 are one range, and are written alike.
        floats = tuple((name, float(low), float(high)) for name, low, high in self.limits)
        object.__setattr__(self, "limits", floats)
        for name, low, high in self.limits:
            if name in NEVER_DRAWN:
                raise InputError(f"range of {name}: it is not drawn; choose it in the preset")
            least, most = parameter_limits(name)
            if not least <= low < high <= most:
                raise InputError(
                    f"range of {name} = [{low:g}, {high:g}]: must rise, within [{least:g}, {most:g}]"
                )

    def draw(self, preset: Preset, rng: np.random.Generator) -> Preset:
        """Return a preset with every parameter that has a range drawn at random, independently."""
        return self.at(preset, rng.random(len(self.limits)))

    def at(self, preset: Preset, shares: NDArray[np.float64]) -> Preset:
        """Return a preset with every parameter at a share of its range, 0 to 1: its quantile in `draw`."""
        ranges = zip(self.limits, shares, strict=True)
        drawn = {name: quantile(low, high, float(share)) for (name, low, high), share in ranges}
        return preset.replace(**drawn)

    def lowest(self, name: str, preset: Preset) -> float:
        """Return the lowest value that a parameter can have; that of the preset if it has no range."""
        return {limits[0]: limits[1] for limits in self.limits}.get(name, float(getattr(preset, name)))

    def wider(self, factor: float) -> "Ranges":
        """Return ranges about the same middles, wider by a factor, within what each parameter may be.

        A range that is drawn log-uniformly is widened in logarithms, so that it stays positive. One whose
        ends come to be more than a factor of `WIDE` apart is drawn log-uniformly from then on.
        """
        limits = []
        for name, low, high in self.limits:
            least, most = parameter_limits(name)
            if _is_wide(low, high):
                middle, half = np.sqrt(low * high), (high / low) ** (factor / 2)
                low, high = middle / half, middle * half
            else:
                middle, half = (low + high) / 2, (high - low) / 2 * factor
                low, high = middle - half, middle + half
            limits.append((name, max(float(low), least), min(float(high), most)))
        return Ranges(tuple(limits))

    def without(self, names: Collection[str]) -> "Ranges":
        """Return the ranges without those of some parameters."""
        return Ranges(tuple(limits for limits in self.limits if limits[0] not in names))

    def to_dict(self) -> dict[str, list[float]]:
        """Return the ranges as a preset file holds them."""
        return {name: [low, high] for name, low, high in self.limits}

    @classmethod
    def from_dict(cls, values: Mapping[str, Sequence[float]]) -> Self:
        """Return the ranges from the values of `to_dict`."""
        return cls(tuple((name, low, high) for name, (low, high) in values.items()))


def load_ranges(name_or_path: str | Path) -> Ranges:
    """Read the ranges of a built-in preset by its name, or of a YAML file."""
    _, values = read_preset_file(name_or_path)
    stated = values.get("ranges")
    if not isinstance(stated, dict) or not stated:
        rule = "add `ranges:` with `parameter: [low, high]` lines"
        raise InputError(f"preset {name_or_path} states no ranges: {rule}")
    for name, limits in stated.items():
        is_pair = isinstance(limits, list) and len(limits) == 2
        if not (is_pair and all(isinstance(end, (int, float)) for end in limits)):
            what = f"range of {cut(str(name), 40)} = {shown(limits)}"
            raise InputError(f"{name_or_path}: {what}: must be [low, high]")
    try:
        return Ranges.from_dict({str(name): limits for name, limits in stated.items()})
    except ValueError as error:
        raise InputError(f"{name_or_path}: {error}") from error


def quantile(low: float, high: float, share: float) -> float:
    """Return the value below which a share, 0 to 1, of what is drawn from a range lies."""
    if _is_wide(low, high):
        return float(np.exp(np.log(low) + share * (np.log(high) - np.log(low))))
    return low + share * (high - low)


def _is_wide(low: float, high: float) -> bool:
    """Return whether a range is drawn log-uniformly."""
    return low > 0 and high / low > WIDE
