"""A training on simulated twins: records, lessons, validation and file, in one run folder."""

import dataclasses
import functools
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch

from rl.options import TRAINING_STROKE_MM, TrainingOptions
from rl.run import Keeper, action_columns, write_curve
from rl.trainers import OnProgress, Simulated, TrainOnTwins
from rl.twins.filter_step import FilterStep
from rl.twins.graph import export_with_model
from rl.twins.learning import learn_gain, learn_interval, validation
from rl.twins.records import (
    SAMPLE_TIME,
    STRIDES,
    Prediction,
    SequenceSource,
    TwinArrays,
    by_model,
    simulate_records,
)
from rl.twins.settings import NetworkTraining, SimulatedTraining
from twin import __version__
from twin.dataset.recipe import check_reached
from twin.estimation.deployment import KEY as DEPLOYMENT
from twin.estimation.deployment import prepare_deployment
from twin.estimation.registry import Training
from twin.files.run_folder import CHECKPOINT_FILE, counted_cost, open_run
from twin.files.state_file import state_key
from twin.hysteresis import ColemanHodgdon, model_to_dict
from twin.identification.models import identify_coleman_hodgdon
from twin.identification.nominal import identify_steps, nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.preset.sensor import KEY as SENSOR
from twin.preset.sensor import SensorModel
from twin.reduced.members import NO_MEMBERS, MemberSet, check_members, members_to_dict

VALIDATIONS = 12  # over each lesson of the gain
_COSTS = {"members": 10, "simulation": 45, "noise_models": 20, "gain": 80, "interval": 25}
"""Time of the parts of a training, relative to each other."""
Settings = TypeVar("Settings", bound=SimulatedTraining)
OnShare = Callable[[int, int], None]  # called with how much of a part is done, and of how much


@dataclasses.dataclass(frozen=True)
class Learner:
    """Method that is trained on twins: all that differs from one to the next."""

    training: Training  # its agent and its file
    # returns the untrained step, and the inputs of its prediction, for the training records
    begin: Callable[[TwinArrays], tuple[FilterStep, Prediction]]
    # writes the trained step with a description, which has the members, to a path
    export: Callable[[Any, dict[str, Any], Path], None]
    # returns the twins that are simulated along every command next to those that are estimated
    choose: Callable[[OnShare], MemberSet] | None = None
    # its lessons: that of the noise models and that of the detector of strange noise, or that of the gain
    prepare: Callable[[Any, OnShare], None] | None = None
    guard: Callable[[Any, SequenceSource], None] | None = None

    @property
    def parts(self) -> list[str]:
        """Parts of the training that take time, by name."""
        if self.prepare:
            return ["members", "simulation", "noise_models", "interval"]
        return ["simulation", "gain", "interval"]


def train_on_twins(
    learner: Learner,  # what is trained
    preset: Preset,  # the endoscope
    ranges: Ranges,  # what varies from one to the next
    settings: SimulatedTraining,  # size and length
    folder: Path,  # where the run is kept
    on_progress: OnProgress | None = None,  # thousandths, their number, minus the square error
) -> Path:
    """Train into a folder (file, `config.yaml`, `progress.csv`) and return the file; a finished run stays.

    A training that was stopped chooses its members and simulates its twins again, and goes on from its
    checkpoint if the members are the same.
    """
    check_members([preset])
    check_reached(preset, settings.stroke_mm)
    configuration = {
        "agent": learner.training.agent,
        "training": json.loads(json.dumps(dataclasses.asdict(settings))),
        "preset": preset.to_dict(),
        "ranges": ranges.to_dict(),
    }
    path = folder / learner.training.file
    with open_run(folder, configuration, (path.name, CHECKPOINT_FILE)):
        if not path.is_file():
            torch.set_num_threads(1)
            torch.manual_seed(settings.seed)
            # Unlikely noise models have weights so small that processors take a hundred cycles for each.
            torch.set_flush_denormal(True)
            try:
                shown = _Shown(on_progress, learner.parts)
                with counted_cost(folder):
                    _train(learner, preset, ranges, settings, configuration, path, shown)
            finally:
                torch.set_flush_denormal(False)
    return path


def _train(
    learner: Learner,
    preset: Preset,
    ranges: Ranges,
    settings: SimulatedTraining,
    configuration: dict[str, Any],
    path: Path,
    shown: "_Shown",
) -> None:
    members = learner.choose(shown.of("members")) if learner.choose else NO_MEMBERS
    records = simulate_records(
        preset,
        ranges,
        members,
        commands=settings.commands,
        twins=settings.twins,
        seconds=settings.seconds,
        stroke_mm=settings.stroke_mm,
        seed=settings.seed,
        on_progress=shown.of("simulation"),
    )
    held_out = max(settings.commands // 12, 1)
    pull_mm, members_deg, truth_deg = records
    learned, others = (
        (pull_mm[part], members_deg[part], truth_deg[part])
        for part in (slice(-held_out), slice(-held_out, None))
    )
    step, predict = learner.begin(learned)
    source, unseen = (
        SequenceSource(part, settings.noises, predict, settings.strides) for part in (learned, others)
    )
    extra = {"members": members_to_dict(members)} if members.presets else {}
    key = state_key(__version__, torch.__version__, configuration, extra)
    columns = ["samples", "mean_reward", "loss", *action_columns(step.actions)]
    if isinstance(settings, NetworkTraining):
        _by_gradient(step, source, unseen, settings, path.parent, key, columns, shown)
    else:
        assert learner.prepare is not None
        learner.prepare(step, shown.of("noise_models"))
        found, _ = validation(step, unseen, settings)
        shown.error = -math.exp(found)
        write_curve(path.parent, [(0, shown.error, math.nan)], columns)
    if learner.guard:
        learner.guard(step, source)
    show = shown.of("interval")
    learn_interval(step, source, settings, lambda update, _: show(update, settings.interval_updates))
    nominal = nominal_records(preset, settings.stroke_mm, settings.seed, SAMPLE_TIME, STRIDES[0])
    sample_time = SAMPLE_TIME * STRIDES[0]
    deployment = prepare_deployment(nominal, identify_steps(nominal), sample_time, settings.seed)
    description = {
        **configuration,
        DEPLOYMENT: deployment.to_dict(),
        SENSOR: SensorModel.of(preset).to_dict(),
        **extra,
    }
    learner.export(step, description, path)  # written last: it marks the run as finished
    (path.parent / CHECKPOINT_FILE).unlink(missing_ok=True)


def _by_gradient(
    step: FilterStep,
    source: SequenceSource,
    unseen: SequenceSource,
    settings: NetworkTraining,
    folder: Path,
    key: str,
    columns: Sequence[str],
    shown: "_Shown",
) -> None:
    """Train a step by back-propagation through the filter, and keep the best weights on unseen twins."""
    each = settings.sequences * settings.window
    every = max(settings.updates // (VALIDATIONS * settings.windows), 1) * settings.windows
    keeper = Keeper(folder / CHECKPOINT_FILE, key, every, step)
    losses: list[float] = []  # since the last validation

    def validate(samples: int) -> None:
        found, actions = validation(step, unseen, settings)
        error = -math.exp(found)
        if error > max((row[1] for row in keeper.curve), default=-math.inf):
            keeper.best = {name: of.detach().clone() for name, of in step.named_parameters()}
        loss = sum(losses) / len(losses) if losses else math.nan
        keeper.curve.append((samples, error, loss, *actions))
        write_curve(folder, keeper.curve, columns)
        losses.clear()
        shown.error = error

    def on_update(update: int, loss: float) -> None:
        losses.append(loss)
        if update % every == 0 or update == settings.updates:
            validate(update * each)
        shown.of("gain")(update, settings.updates)

    learn_gain(step, source.draw, settings, on_update, keeper)
    step.load_state_dict(keeper.best, strict=False)


def scaled_to_options(
    train: Callable[[Preset, Ranges, Settings, Path, OnProgress | None], Path], settings: Settings
) -> TrainOnTwins:
    """Return a training with these settings, scaled by options and changed by those of the material."""

    def run(
        simulated: Simulated, options: TrainingOptions, folder: Path, on_progress: OnProgress | None = None
    ) -> Path:
        chosen = dataclasses.replace(settings.scaled(options), **simulated.settings)
        return train(simulated.preset, simulated.ranges, chosen, folder, on_progress)

    return run


class _Shown:
    """Progress of the parts of a training as one."""

    def __init__(self, on_progress: OnProgress | None, parts: list[str]):
        self.on_progress = on_progress
        self.parts = parts
        self.error = float("nan")

    def of(self, part: str) -> OnShare:
        whole = sum(_COSTS[name] for name in self.parts)
        before = sum(_COSTS[name] for name in self.parts[: self.parts.index(part)])

        def show(done: int, total: int) -> None:
            if self.on_progress:
                share = (before + _COSTS[part] * done / total) / whole
                self.on_progress(round(1000 * share), 1000, self.error)

        return show


def train_with_model(
    training: Training,
    make: Callable[[Any], FilterStep],
    preset: Preset,
    ranges: Ranges,
    settings: SimulatedTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder, as `train_on_twins` does; the file holds the model too."""

    @functools.cache  # found when it is needed: a finished run needs none
    def model() -> ColemanHodgdon:
        return nominal_model(preset, settings.seed)

    def begin(records: TwinArrays) -> tuple[FilterStep, Prediction]:
        return make(settings), by_model(model())

    def export(step: FilterStep, description: dict[str, Any], path: Path) -> None:
        export_with_model(step, description | {"model": model_to_dict(model())}, path)

    return train_on_twins(Learner(training, begin, export), preset, ranges, settings, folder, on_progress)


def nominal_model(preset: Preset, seed: int) -> ColemanHodgdon:
    """Return the model of Coleman and Hodgdon of an endoscope as its preset is, on the paper's stroke."""
    return identify_coleman_hodgdon(
        nominal_records(preset, TRAINING_STROKE_MM, seed, SAMPLE_TIME, STRIDES[0]), seed
    )[0]
