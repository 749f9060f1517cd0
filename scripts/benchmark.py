"""`endotwin benchmark`: measure the speed of everything, and physics at full size."""

import dataclasses
import importlib.util
import json
import sys
from functools import partial
from pathlib import Path

from scripts.command import SeedIgnored, Summary, complain, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import InputError, require_extra

SIZES = ("cycles", "draws", "known", "episodes", "many_episodes")
MOST = 100_000_000


@dataclasses.dataclass(frozen=True)
class Benchmark(SeedIgnored):
    """Measure speed, and physics at full size: JSON and a table.

    Examples:
        endotwin benchmark --out benchmark.json
        endotwin benchmark --only runtime run --out speed.json
    """

    out: Path = Path("benchmark.json")
    """File to write; a table of the same name ends in .md."""
    preset: str = "ureteroscope"
    """Endoscope to measure."""
    amplitude: float = 4.0
    """Amplitude of the commands [mm]."""
    only: tuple[str, ...] = ()
    """Names of the measurements; if not given, all."""
    cycles: int = 1000
    """Random closed cycles."""
    draws: int = 10_000
    """Endoscopes drawn from the randomisation ranges."""
    known: int = 20
    """Known endoscopes that are each calibrated on their own logs."""
    episodes: int = 64
    """Episodes of 60 s in the dataset that is written, measured and read."""
    many_episodes: int = 1000
    """Episodes of 10 s for the measurement of memory."""


def benchmark(args: Benchmark) -> Summary:
    """Write `benchmark.json`; the exit code is 1 where a bar does not hold."""
    require_extra("sim")
    if importlib.util.find_spec("scripts.benchmarks") is None:
        raise InputError("benchmarks are not in the package: run this in a checkout of the repository")
    from scripts.benchmarks import datasets, estimation, learning, physics, pictures, reduced, speed  # noqa: F401
    from scripts.benchmarks.harness import MEASUREMENTS, measure, results_table
    from twin.files.atomic import MADE_BY, write_whole
    from twin.files.bounds import check_between

    check_between("amplitude", args.amplitude, 1e-3, 50.0, "mm")  # more than any pulley pulls
    for name in SIZES:
        check_between(name, getattr(args, name), 1, MOST)
    table = args.out.with_suffix(".md")
    out = output_file(args.out, (".json",), '"peer_value"', companions={table.name: MADE_BY})
    options = {name: getattr(args, name) for name in SIZES}
    names = args.only or tuple(MEASUREMENTS)
    results = measure(names, _begin, preset=args.preset, amplitude=args.amplitude * 1e-3, **options)
    contents = {name: result.to_dict() for name, result in results.items()}
    write_whole(out, json.dumps(contents, indent=2) + "\n")
    write_whole(table, f"{results_table(args.preset, results)}\n<!-- {MADE_BY} -->\n")
    missed = [name for name, result in results.items() if not result.holds]
    line = f"{out}: {len(results) - len(missed)} of {len(results)} bars hold"
    if missed:
        line += f"; missed: {', '.join(missed)}"
    values = {"out": str(out), "missed": missed, **{name: result.value for name, result in results.items()}}
    return Summary(line, values, code=1 if missed else 0)


def _begin(name: str) -> Progress:
    complain(f"benchmark: {name}")
    return Progress(name)


main = partial(run_verb, Benchmark, benchmark)

if __name__ == "__main__":
    sys.exit(main())
