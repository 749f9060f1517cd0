"""Physical parameters of an endoscope: presets, their files, and ranges for domain randomisation."""

from typing import TYPE_CHECKING, Any

from twin.preset.file import load_preset, preset_names
from twin.preset.preset import FIDELITIES, Preset, at_fidelity

if TYPE_CHECKING:
    from twin.preset.randomization import Ranges, load_ranges
else:

    def __getattr__(name: str) -> Any:
        """Load the ranges when they are first used: their files need pydantic, which takes a while."""
        if name not in ("Ranges", "load_ranges"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from twin.preset import randomization

        return getattr(randomization, name)


__all__ = ["FIDELITIES", "Preset", "Ranges", "at_fidelity", "load_preset", "load_ranges", "preset_names"]
