"""Compilation of the reduced twin before workers need it: else each would, and nobody would say why."""

from typing import TYPE_CHECKING

from scripts.command import complain

if TYPE_CHECKING:
    from twin.preset.preset import Preset


def compile_once(command: str, preset: "Preset | None" = None) -> None:
    """Compile the reduced twin here, if it never was.

    Args:
        command: that says so.
        preset: endoscope that is to be simulated; without it, one with one bending plane.
    """
    import numpy as np

    from twin.mechanics import machine_code
    from twin.preset.file import load_preset
    from twin.reduced import simulate

    preset = preset or load_preset("ureteroscope")
    with machine_code.telling(
        lambda: complain(f"{command}: compiling the reduced twin, once: half a minute at most")
    ):
        simulate(preset, np.full(2, preset.command_zeros[0]), preset.control_period)
