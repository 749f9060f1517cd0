"""`endotwin identify`: fit a model of hysteresis to records."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tyro

from scripts.command import Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress


@dataclasses.dataclass(frozen=True)
class Identify:
    """Fit a model of hysteresis to the measured angle of records."""

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    model: str = "coleman-hodgdon"
    """coleman-hodgdon, bouc-wen or prandtl-ishlinskii."""
    out: Path | None = None
    """File to write; if not given, named after the model, as coleman_hodgdon.json."""
    sample_time: float = 0.1
    """Records are thinned to this [s]: the filters that use the model step by it."""
    monotone: bool = False
    """Constrain a coleman-hodgdon model to c >= b / 2, so that loops of any size are monotone."""
    thresholds_mm: tuple[float, ...] = ()
    """Of the plays of a prandtl-ishlinskii model; if not given, eight over the stroke."""
    population: int = 80
    """Candidates of the genetic algorithm; prandtl-ishlinskii needs none."""
    generations: int = 150
    """Number of generations."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def identify(args: Identify) -> Summary:
    """Write the model's file, `coleman_hodgdon.json` or its like."""
    from twin.evaluation.reading import read_episodes, whole_pieces
    from twin.files.atomic import write_whole
    from twin.files.bounds import SAMPLE_TIMES, check_between
    from twin.hysteresis import IdentifiedModel
    from twin.identification import OPTIMIZERS, check_options
    from twin.identification import identify as fit

    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    check_options(
        args.model,
        monotone=args.monotone,
        thresholds_mm=args.thresholds_mm,
        population=args.population,
        generations=args.generations,
    )
    check_between("sample_time", args.sample_time, *SAMPLE_TIMES, "s")
    episodes = read_episodes(args.data, args.sample_time)
    out = args.out or Path(args.model.replace("-", "_") + ".json")
    output_file(out, (".json",), '"rmse_deg"', inputs=args.data)
    progress = Progress("identify", "gen")
    model, rmse = fit(
        [piece for episode in episodes for piece in whole_pieces(episode)],
        args.seed,
        args.model,
        monotone=args.monotone,
        thresholds_mm=args.thresholds_mm,
        population=args.population,
        generations=args.generations,
        on_generation=lambda done, rmse: progress(done, args.generations, f"RMSE {rmse:.3f} deg"),
    )
    values = IdentifiedModel(
        model=model,
        rmse_deg=rmse,
        optimizer=OPTIMIZERS[args.model].format(population=args.population, generations=args.generations),
        seed=args.seed,
        source=", ".join(str(path) for path in args.data),
    ).to_dict()
    write_whole(out, json.dumps(values, indent=2) + "\n")
    parameters = ", ".join(f"{name} = {_text(value)}" for name, value in model.to_dict().items())
    line = f"{out}: {parameters}, RMSE {rmse:.3f} deg over {len(episodes)} records"
    return Summary(line, {"out": str(out), **values})


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "(" + ", ".join(map(_text, value)) + ")" if isinstance(value, list) else f"{value:.4g}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Identify, identify, argv)


if __name__ == "__main__":
    sys.exit(main())
