"""Compile kernels and bytecode once, next to the type checker; each worker of the tests would do it again."""

import importlib
from concurrent.futures import ProcessPoolExecutor

from twin.physics import Endoscope
from twin.preset import load_preset
from twin.reduced import ReducedTwins

PARTS = (1, 2, "gymnasium", "hypothesis", "onnxruntime", "rl.training", "rl.twins.graph", "scripts.report")


def compile_part(part: int | str) -> None:
    """Compile a package, or the kernels of a twin of so many bending planes."""
    if isinstance(part, str):
        importlib.import_module(part)
        return
    preset = load_preset("ureteroscope").replace(bending_planes=part)
    Endoscope.from_preset(preset).advance(1e-3)
    twins = ReducedTwins([preset])
    twins.step(1e-3)
    if part == 1:
        twins.inverse(0.1, stroke=(0.0, 3e-3))
        twins.common_pull([1.0], 0.1, (0.0, 3e-3))


if __name__ == "__main__":
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(compile_part, PARTS))
