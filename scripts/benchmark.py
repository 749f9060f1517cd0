"""`endotwin benchmark`: measure physics, datasets, filters and identification at full size."""

import dataclasses
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tabulate import tabulate

from scripts.command import Progress, Summary, output_file, run_verb
from twin.benchmark import datasets, filters, identification, physics, scaling, speed
from twin.benchmark.result import Result
from twin.files.atomic import write_whole
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges, load_ranges

SHORT: dict[str, Callable[[Preset, float], Result]] = {
    "rate_independence": physics.rate_independence,
    "hold": physics.hold,
    "time_step": physics.time_step,
    "capstan": physics.capstan,
    "return_point": physics.return_point,
    "no_friction": physics.no_friction,
    "vertebrae": physics.vertebrae,
    "speed_one_core": speed.one_core,
    "speed_two_threads": speed.two_threads,
    "cost_of_vertebrae": speed.cost_of_vertebrae,
    "logging": datasets.logging,
    "identification": identification.against_one_at_a_time,
    "identification_plain": identification.against_plain_numbers,
    "cost_of_seeds": scaling.cost_of_seeds,
    "cost_of_samples": scaling.cost_of_samples,
}
LONG = ("closed_cycles", "random_draws", "covariances", "dataset", "memory")


@dataclasses.dataclass(frozen=True)
class Benchmark:
    """Measure physics, datasets, filters and identification at full size, into a JSON file and a table."""

    out: Path = Path("benchmark.json")
    """File to write; a table of the same name ends in .md."""
    preset: str = "ureteroscope"
    """Endoscope to measure."""
    amplitude: float = 4.0
    """Of the commands [mm]."""
    only: tuple[str, ...] = ()
    """Names of measurements; if not given, all."""
    cycles: int = 1000
    """Random closed cycles."""
    draws: int = 10_000
    """Endoscopes drawn from the randomisation ranges."""
    steps: int = 1_000_000
    """Samples over which the covariances of the Kalman filters are watched."""
    episodes: int = 64
    """Of 60 s, of the dataset that is made, weighed and read."""
    many_episodes: int = 1000
    """Of 10 s, while the memory is watched."""
    seed: int = 0
    """Not used: the random measurements are the same every time."""
    json: bool = False
    """Print the summary as one JSON object."""


def benchmark(args: Benchmark) -> Summary:
    """Write `benchmark.json`; the exit code is 1 where a bar does not hold."""
    names = [*SHORT, *LONG]
    for name in args.only:
        if name not in names:
            raise ValueError(f"unknown measurement {name!r}; valid: {', '.join(names)}")
    counts = (args.cycles, args.draws, args.steps, args.episodes, args.many_episodes)
    if min(counts) < 1 or not args.amplitude > 0:
        raise ValueError("all counts and --amplitude must be positive")
    preset = load_preset(args.preset)
    ranges = load_ranges(args.preset) if "random_draws" in (args.only or names) else Ranges(())
    out = output_file(args.out, (".json",))
    amplitude = args.amplitude * 1e-3
    results: dict[str, Result] = {}
    for name in args.only or names:
        print(f"benchmark: {name}", file=sys.stderr)
        if name == "closed_cycles":
            done = Progress(name, "cycle")
            results[name] = physics.closed_cycles(preset, amplitude, args.cycles, done)
        elif name == "random_draws":
            done = Progress(name, "draw")
            results[name] = physics.random_draws(preset, ranges, amplitude, args.draws, done)
        elif name == "covariances":
            results[name] = filters.covariances(args.steps, Progress(name, "filter"))
        elif name == "dataset":
            results |= datasets.dataset(preset, amplitude, args.episodes, Progress(name, "ep"))
        elif name == "memory":
            results[name] = datasets.memory(preset, amplitude, args.many_episodes)
        else:
            results[name] = SHORT[name](preset, amplitude)
    write_whole(
        out, json.dumps({name: result.to_dict() for name, result in results.items()}, indent=2) + "\n"
    )
    write_whole(out.with_suffix(".md"), _table(args.preset, list(results.values())))
    missed = [name for name, result in results.items() if not result.holds]
    line = f"{out}: {len(results) - len(missed)} of {len(results)} bars hold"
    if missed:
        line += f"; missed: {', '.join(missed)}"
    values = {"out": str(out), "missed": missed, **{name: result.value for name, result in results.items()}}
    return Summary(line, values, code=1 if missed else 0)


def _table(preset: str, results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        ratio = "" if result.ratio is None else f"{result.ratio:.3g} times {result.peer}"
        holds = "yes" if result.holds else "no"
        rows.append([result.name, f"{result.value:.3g} {result.unit}", ratio, result.bar, holds])
    headers = ["measurement", "figure", "ratio in the same run", "bar", "holds"]
    table = tabulate(rows, headers=headers, tablefmt="github")
    return f"Preset `{preset}`, by `endotwin benchmark`.\n\n{table}\n"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Benchmark, benchmark, argv)


if __name__ == "__main__":
    sys.exit(main())
