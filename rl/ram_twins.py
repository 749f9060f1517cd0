"""Training of RAM (twins): simulated twins of a preset, then four lessons, into one run folder."""

from pathlib import Path
from typing import Any

from rl.trainers import RATES, OnProgress, Trainer, register_trainer
from rl.twins.graph import export_twins
from rl.twins.laws_lesson import learn_laws
from rl.twins.learning import learn_what_is_familiar
from rl.twins.members import choose_members
from rl.twins.noises import count_laws
from rl.twins.records import TwinRecords
from rl.twins.run import Learner, OnShare, OnWeights, scaled_to_options, train_on_twins
from rl.twins.sequences import Prediction, SequenceSource, by_members, principal_directions
from rl.twins.settings import TwinsTraining
from rl.twins.step import TwinsStep
from twin.estimation.learned.ram_twins import RAM_TWINS, TRAINING
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced.members import MemberSet


def train_ram_twins(
    preset: Preset,
    ranges: Ranges,
    settings: TwinsTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder, as `train_on_twins` does; the file holds the members too."""

    def choose(on_share: OnShare) -> MemberSet:
        return choose_members(
            preset,
            ranges,
            settings.members,
            settings.seed,
            moving=settings.moving,
            stroke_mm=settings.stroke_mm,
            on_progress=on_share,
        )

    def begin(records: TwinRecords) -> tuple[TwinsStep, Prediction]:
        step = TwinsStep(
            principal_directions(records.members_deg, settings.rank),
            count_laws(settings.known_noises),
            settings.policy_width,
            policy_layers=settings.policy_layers,
            with_error=settings.with_error,
        )
        step.goes_along = False  # until the policy has learned
        return step, by_members

    def learn_noise(step: TwinsStep, on_share: OnShare) -> None:
        learn_laws(step.bank.laws, settings, lambda update, _: on_share(update, settings.laws_updates))

    def guard(step: TwinsStep, source: SequenceSource) -> None:
        learn_what_is_familiar(step, source, settings)

    def export(step: TwinsStep, description: dict[str, Any], path: Path) -> None:
        export_twins(step, settings.members, description, path)

    def explore(step: TwinsStep, source: SequenceSource, on_share: OnShare, on_weights: OnWeights) -> None:
        from rl.twins.ppo import learn_by_ppo  # here: other trainings need no stable-baselines3

        learn_by_ppo(step, source, settings, on_share, on_weights)

    learner = Learner(TRAINING, begin, export, choose, prepare=learn_noise, explore=explore, guard=guard)
    return train_on_twins(learner, preset, ranges, settings, folder, on_progress)


register_trainer(
    Trainer(
        RAM_TWINS,
        on_twins=scaled_to_options(train_ram_twins, TwinsTraining()),
        unit="thousandths",
        searched={"learning_rate": RATES, "policy_width": (64, 96)},
    )
)
