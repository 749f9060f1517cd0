"""`python -m scripts.studies.ablation`: train RAM (twins) without each of its parts, and compare all of them.

Every variant is trained with the same seeds for as long as the complete method, and runs on the same records
under the same noise, so that differences are paired.
"""

import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from rl.comparison.full import NewProgress
from rl.options import LIMITS, TrainingOptions
from rl.sweep import Shares, TrainingRun, folder_of, seeds_from, train_side_by_side
from rl.trainers import Material, OnProgress, Simulated
from scripts.command import Options, Summary, command_line, compile_once, run_verb
from scripts.outputs import output_folder
from scripts.progress import Progress, TrainingProgress
from twin.errors import InputError
from twin.estimation.estimator import Estimator
from twin.estimation.learned import ram_twins, step
from twin.estimation.load import load_estimator
from twin.estimation.registry import find_training
from twin.evaluation.compare import Comparison, compare
from twin.evaluation.method import Filtering, Method
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import Protocol
from twin.evaluation.ranking import times_reference
from twin.evaluation.reading import evaluation_records
from twin.evaluation.scenarios import write_scenarios
from twin.evaluation.score import mean_coverage, rmse_by
from twin.files.atomic import MADE_BY, write_whole
from twin.files.bounds import LONGEST_SECONDS, MOST_SEEDS, check_between
from twin.files.origin import origin_of
from twin.preset import Preset, Ranges, load_preset, load_ranges
from twin.report.figures import INK, MUTED, clean_axes, to_png_bytes
from twin.report.tables import aligned_table, in_brackets, twin_name
from twin.workers.processes import choose_workers, shared_table

NAME = "ablation"
Row = dict[str, Any]  # a variant and what it reaches, as `ablation.json` holds it
WHOLE = "whole"
COLOUR = "#a3195b"
SHOWN = (("gaussian", 1.0), ("poisson-dithered", 2.0), ("gamma", 1.0), ("salt-and-pepper", 0.05))
"""Noises that have a column of their own: a symmetric one, skewed ones, outliers."""
_TICKS = (0.5, 0.7, 0.8, 0.9, 1, 1.1, 1.2, 1.3, 1.5, 1.7, 2, 3, 5, 7, 10)
SYMMETRIC = ("gaussian", "uniform", "laplace", "student-t", "salt-and-pepper")


@dataclasses.dataclass(frozen=True)
class Variant:
    """RAM (twins) with one thing changed: settings of its training, or parts of a trained file that act."""

    name: str
    change: str  # in the words of the table
    agent: str = ram_twins.AGENT
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    parts: tuple[float, float] | None = None  # see `twin.estimation.learned.ram_twins`


VARIANTS = (
    Variant(WHOLE, "nothing: the whole"),
    Variant("no-twins", "no twins online: RAM (memory)", agent="ram-memory"),
    Variant("few-members", "a quarter of the members", settings={"members": 10, "moving": 4, "rank": 7}),
    Variant("still-members", "no member's sheath moves", settings={"moving": 0}),
    Variant("no-error", "no model-error state", settings={"with_error": False}),
    Variant("no-recogniser", "no recogniser: the noise is normal", settings={"with_classifier": False}),
    Variant("filter-alone", "no recogniser where it runs (filter alone)", parts=step.FILTER_ALONE),
    Variant("gaussian", "trained under Gaussian noise alone", settings={"noises": ("gaussian",)}),
    Variant("symmetric", "trained under symmetric noises alone", settings={"noises": SYMMETRIC}),
    Variant("one-sample-time", "trained at T = 0.1 s alone", settings={"sample_times": (0.1,)}),
)
"""The complete method first, then those without a part of it."""


@dataclasses.dataclass(frozen=True)
class Ablation:
    """Settings of an ablation; the folder keeps records and training runs, finished ones are used again."""

    folder: Path
    preset: Preset
    ranges: Ranges
    options: TrainingOptions  # of every training run, but for agent and seed
    seeds: Sequence[int]  # of the training runs of each variant
    variants: Sequence[Variant] = VARIANTS  # the complete method among them
    draws: int = 1  # of each noise
    seconds: float = 60.0  # length of the records
    seed: int = 1  # of records and noise

    def folder_of(self, variant: Variant) -> Path:
        """Return the folder of the training runs of a variant."""
        return self.folder / (WHOLE if variant.parts else variant.name)


def chosen_variants(names: Sequence[str]) -> list[Variant]:
    """Return variants by name, always with the complete method; all, if none is named."""
    known = {variant.name: variant for variant in VARIANTS}
    for name in names:
        if name not in known:
            raise InputError(f"unknown variant {name!r}; valid: {', '.join(known)}")
    return [variant for name, variant in known.items() if not names or name in (WHOLE, *names)]


def run_ablation(
    ablation: Ablation,
    executor: Executor,
    progress: NewProgress,
    on_training: OnProgress | None = None,
    shares: Shares | None = None,
) -> list[Row]:
    """Train all variants in parallel, run them on the suite's records, and return the table's rows.

    Errors are geometric means of the RMSE; `times_whole` is in units of the whole, with its paired interval.
    """
    shown = progress("test records", "ep")
    paths = write_scenarios(
        ablation.folder / "records", ablation.preset, ablation.ranges, ablation.seconds, ablation.seed
    )
    shown(len(paths), len(paths))
    train_side_by_side(_runs(ablation), executor, on_training, shares)
    protocol = Protocol("full", ablation.draws, seed=ablation.seed)
    records = evaluation_records(paths, protocol.sample_time_s)
    methods = [_method(ablation, variant) for variant in ablation.variants]
    found = compare(records, methods, protocol, progress("evaluate", "group"), executor)
    return _rows(found, ablation.variants)


def _runs(ablation: Ablation) -> list[TrainingRun]:
    runs = []
    for variant in ablation.variants:
        if variant.parts:
            continue
        material = Material(simulated=Simulated(ablation.preset, ablation.ranges, settings=variant.settings))
        for seed in ablation.seeds:
            options = dataclasses.replace(ablation.options, agent=variant.agent, seed=seed)
            runs.append(TrainingRun(material, options, folder_of(ablation.folder_of(variant), seed)))
    return runs


def _method(ablation: Ablation, variant: Variant) -> Method:
    name, folder = find_training(variant.agent).file, ablation.folder_of(variant)
    loaded: list[Estimator[Any]] = [load_estimator(folder_of(folder, seed) / name) for seed in ablation.seeds]
    if variant.parts:
        loaded = [dataclasses.replace(each, parts=variant.parts) for each in loaded]  # type: ignore[type-var]
    first, *others = map(Filtering, loaded)
    return Method(variant.name, first, others=tuple(others))


def _rows(found: Comparison, variants: Sequence[Variant]) -> list[Row]:
    groups: dict[Any, dict[str, list[Any]]] = {}
    for score, squares in zip(found.scores, found.squares, strict=True):
        groups.setdefault(score.group, {}).setdefault(score.method, []).append(squares)
    together = [{name: np.stack(of, axis=1) for name, of in group.items()} for group in groups.values()]
    times = times_reference(together, WHOLE)
    rows = []
    for variant in variants:
        scores = [score for score in found.scores if score.method == variant.name]
        ratio, interval = times[variant.name]
        by_noise = rmse_by(scores, lambda score: score.condition)
        noises = [{"noise": of[0], "level": of[1], "rmse_deg": error} for of, error in by_noise.items()]
        rows.append(
            {
                "name": variant.name,
                "change": variant.change,
                "by_twin_deg": rmse_by(scores, lambda score: score.twin),
                "by_noise_deg": noises,
                "times_whole": ratio,
                "times_whole_ci95": interval,
                "coverage95": mean_coverage(scores),
                "trainings": scores[0].trainings,
            }
        )
    return rows


def ablation_table(rows: Sequence[Row]) -> str:
    """Return the variants as a table in Markdown."""
    twins = list(rows[0]["by_twin_deg"])
    errors = [{(of["noise"], of["level"]): of["rmse_deg"] for of in row["by_noise_deg"]} for row in rows]
    noises = [noise for noise in SHOWN if noise in errors[0]]
    lines = [
        [
            row["change"],
            *(f"{row['by_twin_deg'][twin]:.2f}" for twin in twins),
            *(f"{own[noise]:.2f}" for noise in noises),
            f"{row['times_whole']:.2f}" + in_brackets(row["times_whole_ci95"], ".2f"),
            "-" if row["coverage95"] is None else f"{100 * row['coverage95']:.0f}",
            str(row["trainings"]),
        ]
        for row, own in zip(rows, errors, strict=True)
    ]
    headers = [
        "what is changed",
        *map(twin_name, twins),
        *(noise_label(*noise) for noise in noises),
        "times the whole",
        "coverage [%]",
        "trainings",
    ]
    return aligned_table(lines, headers)


def ablation_figure(rows: Sequence[Row]) -> Figure:
    """Draw each variant's error in units of the whole's, with its paired 95 % interval."""
    figure = Figure(figsize=(6.4, 0.26 * len(rows) + 0.9), layout="constrained")
    axes = figure.subplots()
    clean_axes(axes)
    axes.axvline(1.0, color=MUTED, linewidth=0.8)
    for line, row in enumerate(reversed(rows)):
        if row["times_whole_ci95"] is not None:
            axes.plot(row["times_whole_ci95"], [line, line], color=COLOUR, linewidth=1.4)
        axes.plot(row["times_whole"], line, "o", markersize=4.5, color=COLOUR)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_major_locator(FixedLocator(_TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yticks(range(len(rows)), [row["change"] for row in reversed(rows)], fontsize=8, color=INK)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.tick_params(labelsize=8)
    axes.set_xlabel("RMSE over that of the whole, paired 95 % interval", fontsize=8, color=INK)
    return figure


@dataclasses.dataclass(frozen=True)
class Ablate(Options):
    """Train RAM (twins) with one thing changed each, and compare all on the suite's records.

    Training runs and records are kept in the folder; a stopped run continues.
    """

    out: Path
    """Folder for ablation.json, ablation.md, ablation.png, and a folder of trainings for each variant."""
    variants: tuple[str, ...] = ()
    """Names of the variants; all, if not given. The complete method is always among them."""
    preset: str = "ureteroscope"
    """Endoscope, and the ranges that its twins are drawn from: a name or a YAML file."""
    episodes: int = TrainingOptions.episodes
    """Length of every training run; see `endotwin train`."""
    seeds: int = 3
    """Training runs of each variant, with seeds from 1 on."""
    draws: int = 1
    """Of each noise."""
    seconds: float = 60.0
    """Length of the records."""
    seed: int = 1
    """Of records and noise; 1 is that of the frozen test set."""
    workers: int = 0
    """Processes; 0 for one per core. The results do not depend on it."""


def ablate(args: Ablate) -> Summary:
    """Write `ablation.json`, `ablation.md` and `ablation.png`."""
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
    files = [args.out / f"{NAME}.{ending}" for ending in ("json", "md", "png")]
    signs = ('"times_whole"', MADE_BY, MADE_BY)
    output_folder(args.out, {file.name: sign for file, sign in zip(files, signs, strict=True)})
    compile_once("endotwin")
    trainings = args.seeds * len(ablation.variants)
    with choose_workers(trainings, args.workers) as (executor, _), shared_table() as shares:
        progress = TrainingProgress(f"train {len(ablation.variants)} variants", "thousandths")
        rows = run_ablation(ablation, executor, Progress, progress, shares)
    command = command_line("ablation", args).replace("endotwin ", "python -m scripts.studies.", 1)
    contents = {"rows": rows, "origin": origin_of(command, [])}
    table = ablation_table(rows)
    write_whole(files[0], json.dumps(contents, indent=2, allow_nan=False) + "\n")
    write_whole(files[1], f"{table}\n\n<!-- {MADE_BY} -->\n")
    write_whole(files[2], to_png_bytes(ablation_figure(rows)))
    line = f"{files[0]}: {len(rows)} variants, {args.seeds} trainings each"
    return Summary(line, {"out": str(files[0]), "rows": len(rows)}, table=table)


main = partial(run_verb, Ablate, ablate)

if __name__ == "__main__":
    sys.exit(main())
