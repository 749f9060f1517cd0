"""Compilation of the reduced twin before workers need it: else each would, and nobody would say why."""

from scripts.ending import complain


def compile_once(command: str) -> None:
    """Compile the reduced twin here, if it never was.

    Args:
        command: that says so.
    """
    from twin.mechanics.machine_code import has_machine_code

    if has_machine_code("reduced"):
        return
    import numpy as np

    from twin.preset.file import load_preset
    from twin.reduced import simulate

    complain(f"{command}: compiling the reduced twin, once: half a minute")
    simulate(load_preset("ureteroscope"), np.zeros(2), 0.1)
