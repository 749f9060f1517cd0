"""Physical parameters of an endoscope: presets, their files, and ranges for domain randomisation."""

from twin.preset.file import load_preset, preset_names
from twin.preset.preset import FIDELITIES, Preset, at_fidelity
from twin.preset.randomization import Ranges, load_ranges

__all__ = ["FIDELITIES", "Preset", "Ranges", "at_fidelity", "load_preset", "load_ranges", "preset_names"]
