"""The parameters of a preset, and values that they may have."""

import dataclasses
from pathlib import Path

from hypothesis import strategies as st

from twin.preset.preset import Preset, parameter_limits

NUMBERS = [field.name for field in dataclasses.fields(Preset) if field.name != "name"]
COUNTS = {
    "bending_planes": (1, 2),
    "wires_per_plane": (1, 2),
    "vertebrae": (1, 128),
    "sheath_elements": (1, 64),
    "encoder_counts": (0, 2**24),
}
PERIODS = {"time_step", "control_period"}


def values_of(names) -> st.SearchStrategy[dict]:
    """Some of the parameters, each anywhere within its limits."""
    optional = {}
    for name in names:
        numbers = st.integers if name in COUNTS else st.floats
        optional[name] = numbers(*parameter_limits(name))
    return st.fixed_dictionaries({}, optional=optional)


def write(folder: Path, text: str) -> Path:
    """A preset's file of a text."""
    path = folder / "mine.yaml"
    path.write_text(text)
    return path
