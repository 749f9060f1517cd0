"""Ablation of RAM (twins): the same training without one of its parts each, on the benchmark's records.

Every variant is trained with the same seeds for as long as the whole, and meets the same noise on the same
records, so that differences are told in pairs.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from rl.options import TrainingOptions
from rl.suite.settings import NewProgress
from rl.sweep import Shares, TrainingRun, folder_of, train_side_by_side
from rl.trainers import Material, OnProgress, Simulated
from twin.errors import InputError
from twin.estimation.estimator import Estimator
from twin.estimation.learned import ram_memory, ram_twins
from twin.estimation.registry import find_training
from twin.evaluation.compare import ScoredRuns, evaluate
from twin.evaluation.means import mean_coverage, rmse_by
from twin.evaluation.method import Filtering, Method
from twin.evaluation.protocol import Protocol
from twin.evaluation.ranking import times_reference
from twin.evaluation.reading import evaluation_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.report.ablation import AblationRow
from twin.signals.streams import SeedUse, random_stream
from twin.suite.scenarios import write_scenarios

WHOLE = "whole"
SYMMETRIC = ("gaussian", "uniform", "laplace", "student-t", "salt-and-pepper")


@dataclasses.dataclass(frozen=True)
class Variant:
    """RAM (twins) with one thing changed.

    Attributes:
        name: of its folder.
        change: in words, for the table.
        agent: that is trained.
        settings: of the training that differ from the whole's, by name.
        parts: of a trained file that act, where nothing is trained anew; `twin.estimation.learned.ram_twins`.
    """

    name: str
    change: str
    agent: str = ram_twins.AGENT
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    parts: tuple[float, float] | None = None


VARIANTS = (
    Variant(WHOLE, "nothing: the whole"),
    Variant("no-twins", "no twins online: RAM (memory)", agent=ram_memory.AGENT),
    Variant("few-members", "a quarter of the members", settings={"members": 10, "moving": 4, "rank": 7}),
    Variant("still-members", "no member's sheath moves", settings={"moving": 0}),
    Variant("no-error", "no model-error state", settings={"with_error": False}),
    Variant("no-recogniser", "no recogniser: the noise is normal", settings={"with_recogniser": False}),
    Variant("recogniser-alone", "no policy (recogniser alone)", parts=ram_twins.RECOGNISER_ALONE),
    Variant("filter-alone", "neither of them (filter alone)", parts=ram_twins.FILTER_ALONE),
    Variant("linear-policy", "a linear policy", settings={"policy_layers": 0}),
    Variant("no-penalty", "no penalty for leaving the linear update", settings={"linear_penalty": 0.0}),
    Variant("ppo", "policy by PPO, from scratch", settings={"gain": ("ppo",)}),
    Variant("analytic-ppo", "policy by gradient, then PPO", settings={"gain": ("analytic", "ppo")}),
    Variant("gaussian", "trained under Gaussian noise alone", settings={"noises": ("gaussian",)}),
    Variant("symmetric", "trained under symmetric noises alone", settings={"noises": SYMMETRIC}),
    Variant("one-sample-time", "trained at T = 0.1 s alone", settings={"sample_times": (0.1,)}),
)
"""The whole first, then what is left where a part of it is missing or another."""


@dataclasses.dataclass(frozen=True)
class Ablation:
    """Everything that an ablation is run on.

    Attributes:
        folder: for records and trainings; what is finished there is taken up.
        preset: the endoscope of records and trainings.
        ranges: that randomised twins are drawn from.
        options: of every training, but for agent and seed.
        seeds: of the trainings of each variant.
        variants: the whole among them.
        draws: of each noise.
        seconds: length of the records.
        seed: of records and noise.
    """

    folder: Path
    preset: Preset
    ranges: Ranges
    options: TrainingOptions
    seeds: Sequence[int]
    variants: Sequence[Variant] = VARIANTS
    draws: int = 1
    seconds: float = 60.0
    seed: int = 1

    def folder_of(self, variant: Variant) -> Path:
        """Return the folder of the trainings of a variant; where nothing is trained anew, the whole's."""
        return self.folder / (WHOLE if variant.parts else variant.name)


def chosen_variants(names: Sequence[str]) -> list[Variant]:
    """Return variants by name, and the whole, which all are measured against; all, if none is named.

    Raises:
        ValueError: there is none of a name.
    """
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
) -> list[AblationRow]:
    """Train all variants side by side, run them on the benchmark's records, and return the table's rows.

    Args:
        ablation: what to run.
        executor: where trainings and groups of records are worked on.
        progress: begins to show the progress of a stage.
        on_training: told of the trainings, as `rl.sweep.train_seeds` tells.
        shares: where workers tell how far they are.
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
    found = evaluate(records, methods, protocol, progress("evaluate", "group"), executor)
    return _rows(found, ablation.variants, random_stream(ablation.seed, SeedUse.ABLATION))


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
    """Return a variant's trainings as one row of a comparison."""
    training, folder = find_training(variant.agent), ablation.folder_of(variant)
    loaded: list[Estimator[Any]] = [
        training.load(folder_of(folder, seed) / training.file) for seed in ablation.seeds
    ]
    if variant.parts:
        loaded = [dataclasses.replace(each, parts=variant.parts) for each in loaded]  # type: ignore[type-var]
    first, *others = map(Filtering, loaded)
    return Method(variant.name, first, others=tuple(others))


def _rows(found: ScoredRuns, variants: Sequence[Variant], rng: np.random.Generator) -> list[AblationRow]:
    """Return a row for each variant of a comparison."""
    groups: dict[Any, dict[str, list[Any]]] = {}
    for score, squares in zip(found.scores, found.squares, strict=True):
        groups.setdefault(score.group, {}).setdefault(score.method, []).append(squares)
    together = [{name: np.stack(of, axis=1) for name, of in group.items()} for group in groups.values()]
    times = times_reference(together, WHOLE, rng)
    rows = []
    for variant in variants:
        scores = [score for score in found.scores if score.method == variant.name]
        ratio, interval = times[variant.name]
        rows.append(
            AblationRow(
                name=variant.name,
                change=variant.change,
                by_twin_deg=rmse_by(scores, lambda score: score.twin),
                by_noise_deg=rmse_by(scores, lambda score: score.condition),
                times_whole=ratio,
                times_whole_ci95=interval,
                coverage95=mean_coverage(scores),
                trainings=scores[0].trainings,
            )
        )
    return rows
