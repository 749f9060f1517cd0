"""Compilation of the reduced twin before workers need it: else each would, without a message."""

from typing import TYPE_CHECKING

from scripts.command import complain

if TYPE_CHECKING:
    from twin.preset.preset import Preset


def compile_once(command: str, preset: "Preset | None" = None) -> None:
    """Compile the reduced twin for a preset, or for one bending plane; the command prints that once."""
    import numpy as np

    from twin.mechanics.kernels import on_compile
    from twin.preset.file import load_preset
    from twin.reduced import simulate

    preset = preset or load_preset("ureteroscope")
    with on_compile(lambda: complain(f"{command}: compiling the reduced twin, once: a minute at most")):
        simulate(preset, np.full(2, preset.command_zeros[0]), preset.control_period)
