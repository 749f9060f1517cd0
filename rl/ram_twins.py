"""Training of RAM (twins): simulated twins of a preset, then three lessons, into one run folder."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from rl.compiled_code import no_folder_of_compiled_code
from rl.options import TrainingOptions, share_of
from rl.run import write_curve
from rl.trainers import OnProgress, Trainer, register_trainer
from rl.twins.checkpoint import Keeper
from rl.twins.graph import export_step
from rl.twins.learning import learn_gain, learn_interval, learn_noise, validation_loss
from rl.twins.records import draw_members, simulate_records
from rl.twins.sequences import SequenceSource, principal_directions, split_records
from rl.twins.settings import TwinsTraining
from rl.twins.step import TwinsStep
from twin import __version__
from twin.estimation.learned.ram_twins import RAM_TWINS, TRAINING
from twin.files.run_folder import CHECKPOINT_FILE, open_run
from twin.files.state_file import state_key
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced.following import check_members, members_to_dict

VALIDATIONS = 12  # over the lesson of the gain
_COSTS = (0.35, 0.15, 0.45, 0.05)  # share of simulation and of the three lessons in the time of a training


def train_ram_twins(
    preset: Preset,
    ranges: Ranges,
    settings: TwinsTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder (`policy.onnx`, `config.yaml`, `progress.csv`); a finished run stays.

    A training that was stopped simulates its twins again and goes on from its checkpoint.

    Args:
        preset: the endoscope.
        ranges: what varies from one to the next.
        settings: size and length.
        folder: where the run is kept.
        on_progress: told thousandths done, their number, and minus the typical square error on twins that are
            held out [deg^2].

    Returns:
        The trained file.

    Raises:
        ValueError: the preset has a second bending plane or gravity, or the folder holds another run.
        FloatingPointError: a simulation or the training diverged.
    """
    check_members([preset])
    configuration = {
        "training": dataclasses.asdict(settings) | {"noises": list(settings.noises)},
        "preset": preset.to_dict(),
        "ranges": ranges.to_dict(),
    }
    path = folder / TRAINING.file
    with open_run(folder, configuration, (path.name, CHECKPOINT_FILE)), no_folder_of_compiled_code():
        if not path.is_file():
            torch.set_num_threads(1)
            torch.manual_seed(settings.seed)
            # Weights of unlikely laws are numbers so small that processors take a hundred cycles for each.
            torch.set_flush_denormal(True)
            try:
                _train(preset, ranges, settings, configuration, path, _Shown(on_progress))
            finally:
                torch.set_flush_denormal(False)
    return path


def _train(
    preset: Preset,
    ranges: Ranges,
    settings: TwinsTraining,
    configuration: dict[str, Any],
    path: Path,
    shown: "_Shown",
) -> None:
    """Simulate, learn, and write the curve and the file."""
    members = draw_members(preset, ranges, settings.members, settings.seed)
    records = simulate_records(
        preset,
        ranges,
        members,
        commands=settings.commands,
        twins=settings.twins,
        seconds=settings.seconds,
        seed=settings.seed,
        on_progress=shown.of(0),
    )
    learned, held_out = split_records(records, max(settings.commands // 12, 1))
    source, unseen = (SequenceSource(part, settings.noises) for part in (learned, held_out))
    step = TwinsStep(principal_directions(learned.members_deg, settings.rank))
    each = settings.sequences * settings.window
    windows = settings.windows
    every = max(settings.updates // (VALIDATIONS * windows), 1) * windows
    key = state_key(__version__, torch.__version__, configuration)
    keeper = Keeper(path.parent / CHECKPOINT_FILE, key, every, step)

    def validate(update: int, loss: float) -> None:
        if update % every == 0 or update == settings.updates:
            error = -math.exp(validation_loss(step, unseen, settings))
            if error > max((reward for _, reward in keeper.curve), default=-math.inf):
                keeper.best = {name: of.detach().clone() for name, of in step.named_parameters()}
            keeper.curve.append((update * each, error))
            write_curve(path.parent, keeper.curve)
            shown.error = error
        shown.of(2)(update, settings.updates)

    if not keeper.is_there():
        show = shown.of(1)
        learn_noise(step, source, settings, lambda update, _: show(update, settings.recogniser_updates))
    learn_gain(step, source, settings, validate, keeper)
    step.load_state_dict(keeper.best, strict=False)
    show = shown.of(3)
    learn_interval(step, source, settings, lambda update, _: show(update, settings.interval_updates))
    description = {"agent": TRAINING.agent, "members": members_to_dict(members), **configuration}
    export_step(step, settings.members, description, path)  # the last: where the file is, the run is finished
    keeper.remove()


class _Shown:
    """Progress of the parts of a training as one."""

    def __init__(self, on_progress: OnProgress | None):
        self.on_progress = on_progress
        self.error = float("nan")

    def of(self, part: int) -> Callable[[int, int], None]:
        """Return what is told how much of a part is done."""

        def show(done: int, total: int) -> None:
            if self.on_progress:
                share = sum(_COSTS[:part]) + _COSTS[part] * done / total
                self.on_progress(round(1000 * share), 1000, self.error)

        return show


def _train_with_options(
    preset: Preset,
    ranges: Ranges,
    options: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    full = TwinsTraining()
    settings = dataclasses.replace(
        full,
        recogniser_updates=share_of(full.recogniser_updates, options),
        updates=share_of(full.updates, options),
        interval_updates=share_of(full.interval_updates, options),
        commands=max(share_of(full.commands, options), 6),
        recogniser_sequences=max(share_of(full.recogniser_sequences, options), 64),
        interval_sequences=max(share_of(full.interval_sequences, options), 64),
        seed=options.seed,
    )
    return train_ram_twins(preset, ranges, settings, folder, on_progress)


register_trainer(Trainer(RAM_TWINS, on_twins=_train_with_options, unit="thousandths"))
