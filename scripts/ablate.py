"""`python -m scripts.ablate`: train RAM (twins) without each of its parts, and say what each is worth."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rl.options import TrainingOptions
from scripts.command import Summary, command_line, run_verb
from scripts.compiling import compile_once
from scripts.outputs import output_folder
from scripts.progress import Progress, TrainingProgress
from twin.errors import require_extra
from twin.files.atomic import MADE_BY

NAME = "ablation"


@dataclasses.dataclass(frozen=True)
class Ablate:
    """Train RAM (twins) with one thing changed each, and compare all on the benchmark's records.

    Trainings and records are kept in the folder; a stopped run goes on.
    """

    out: Path
    """Folder for ablation.json, ablation.md, ablation.png, and a folder of trainings for each variant."""
    variants: tuple[str, ...] = ()
    """Names of the variants; all, if not given. The whole is always among them."""
    preset: str = "ureteroscope"
    """Endoscope, and the ranges that its twins are drawn from: a name or a YAML file."""
    episodes: int = TrainingOptions.episodes
    """Length of every training, as of `endotwin train`."""
    seeds: int = 3
    """Trainings of each variant, with seeds from 1 on."""
    draws: int = 1
    """Of each noise."""
    seconds: float = 60.0
    """Length of the records."""
    seed: int = 1
    """Of records and noise; 1 is that of the frozen test set."""
    workers: int = 0
    """Processes; 0 for one per core. The results do not depend on it."""
    json: bool = False
    """Print the summary as one JSON object."""


def ablate(args: Ablate) -> Summary:
    """Write `ablation.json`, `ablation.md` and `ablation.png`."""
    for extra in ("sim", "viz"):
        require_extra(extra)
    from rl.options import LIMITS
    from rl.suite.ablation import Ablation, chosen_variants, run_ablation
    from rl.sweep import seeds_from
    from twin.files.atomic import write_whole
    from twin.files.bounds import LONGEST_SECONDS, MOST_SEEDS, check_between
    from twin.files.origin import origin_of
    from twin.preset import load_preset, load_ranges
    from twin.report.ablation import ablation_figure, ablation_table
    from twin.report.figures import to_png_bytes
    from twin.workers.processes import choose_workers, shared_table

    check_between("draws", args.draws, 1, MOST_SEEDS)
    check_between("episodes", args.episodes, *LIMITS["episodes"])
    check_between("seconds", args.seconds, 5, LONGEST_SECONDS, "s")
    ablation = Ablation(
        args.out,
        load_preset(args.preset),
        load_ranges(args.preset),
        TrainingOptions(episodes=args.episodes),
        seeds_from(1, args.seeds),
        chosen_variants(args.variants),
        args.draws,
        args.seconds,
        args.seed,
    )
    output_folder(args.out, {f"{NAME}.json": '"times_whole"', f"{NAME}.md": MADE_BY, f"{NAME}.png": MADE_BY})
    compile_once("endotwin")
    trainings = args.seeds * len(ablation.variants)
    with choose_workers(trainings, args.workers) as (executor, _), shared_table() as shares:
        progress = TrainingProgress(f"train {len(ablation.variants)} variants", "thousandths")
        rows = run_ablation(ablation, executor, Progress, progress, shares)
    command = command_line("ablate", args, ("out",)).replace("endotwin ", "python -m scripts.", 1)
    contents = {"rows": [row.to_dict() for row in rows], "origin": origin_of(command, [])}
    table = ablation_table(rows)
    write_whole(args.out / f"{NAME}.json", json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(args.out / f"{NAME}.md", f"{table}\n\n<!-- {MADE_BY} -->\n")
    write_whole(args.out / f"{NAME}.png", to_png_bytes(ablation_figure(rows)))
    line = f"{args.out}/{NAME}.json: {len(rows)} variants, {args.seeds} trainings each"
    return Summary(line, {"out": str(args.out / f"{NAME}.json"), "rows": len(rows)}, table=table)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the script."""
    return run_verb(Ablate, ablate, argv)


if __name__ == "__main__":
    sys.exit(main())
