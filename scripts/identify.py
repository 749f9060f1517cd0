"""`endotwin identify`: fit the Coleman-Hodgdon model to records."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import tyro

from scripts.command import Progress, Summary, output_file, run_verb
from scripts.records import read_episodes
from twin.hysteresis import IdentifiedModel
from twin.identification import identify as fit
from twin.recording.atomic import write_whole


@dataclasses.dataclass(frozen=True)
class Identify:
    """Fit the Coleman-Hodgdon model to the measured angle of records, by a genetic algorithm."""

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    out: Path = Path("coleman_hodgdon.json")
    """File to write."""
    sample_time: float = 0.1
    """Records are thinned to this [s]: the filters that use the model step by it."""
    monotone: bool = False
    """Constrain c >= b / 2, so that loops of any size are monotone."""
    population: int = 80
    """Candidates of the genetic algorithm."""
    generations: int = 150
    """How many of them."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def identify(args: Identify) -> Summary:
    """Write `coleman_hodgdon.json`."""
    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    episodes = read_episodes(args.data, args.sample_time)
    out = output_file(args.out, (".json",))
    progress = Progress("identify", "gen")
    model, rmse = fit(
        [(episode.pull_mm, episode.measured_bend_deg) for episode in episodes],
        args.seed,
        monotone=args.monotone,
        population=args.population,
        generations=args.generations,
        on_generation=lambda done, rmse: progress(done, args.generations, f"RMSE {rmse:.3f} deg"),
    )
    values = IdentifiedModel(
        model=model,
        rmse_deg=rmse,
        optimizer=f"pymoo GA, population {args.population}, generations {args.generations}",
        seed=args.seed,
        source=", ".join(str(path) for path in args.data),
    ).to_dict()
    write_whole(out, json.dumps(values, indent=2) + "\n")
    parameters = "a = {a_per_mm:.4g} /mm, b = {b_deg_per_mm:.4g} deg/mm, c = {c_deg_per_mm:.4g} deg/mm"
    line = f"{out}: {parameters.format(**values)}, RMSE {rmse:.3f} deg over {len(episodes)} records"
    return Summary(line, {"out": str(out), **values})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Identify, identify, argv)


if __name__ == "__main__":
    sys.exit(main())
