"""Settings of the training of RAM (twins)."""

import dataclasses

from rl.twins.noises import FAMILIES, check_families
from rl.twins.records import SAMPLE_TIME
from rl.twins.sequences import STRIDES
from twin.errors import InputError
from twin.files.bounds import check_between
from twin.files.trained_schema import MOST_MEMBERS


@dataclasses.dataclass(frozen=True)
class TwinsTraining:
    """Settings of the training on simulated twins.

    Attributes:
        members: M, twins that the prediction is made of.
        rank: r, directions among them that are estimated.
        commands: C, each followed by all members.
        twins: K, others along each command, whose angle is estimated.
        seconds: length of a record.
        sequences: with their own noise, that run side by side.
        episode: samples until all begin anew, on other records.
        window: samples that an error is traced back over.
        recogniser_sequences: records that the recogniser learns from first.
        recogniser_updates: gradient steps of that.
        updates: gradient steps through the filter, one per window.
        interval_sequences: that the width of the interval is learned from.
        interval_updates: gradient steps of that.
        recogniser_rate: step of Adam for the recogniser at the start; it falls to zero along a cosine.
        learning_rate: the same through the filter.
        linear_penalty: weight of what the policy does under Gaussian noise, where doing nothing is best.
        bias_weight: weight of the recogniser's own loss beside the error of the estimate.
        noises: families of `rl.twins.noises` that are met.
        seed: of everything that is drawn.
    """

    members: int = 32
    rank: int = 16
    commands: int = 90
    twins: int = 8
    seconds: float = 40.0
    sequences: int = 96
    episode: int = 300
    window: int = 50
    recogniser_sequences: int = 4096
    recogniser_updates: int = 2500
    updates: int = 2400
    interval_sequences: int = 1536
    interval_updates: int = 1500
    recogniser_rate: float = 3e-3
    learning_rate: float = 3e-3
    linear_penalty: float = 0.3
    bias_weight: float = 0.05
    noises: tuple[str, ...] = tuple(FAMILIES)
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a training that cannot run.

        Raises:
            ValueError: records are shorter than an episode, or a file could not hold the members.
        """
        check_families(self.noises)
        check_between("members", self.members, 2, MOST_MEMBERS)
        check_between("rank", self.rank, 1, self.members)
        if not self.window <= self.episode <= int(self.seconds / (SAMPLE_TIME * STRIDES[0])) - 1:
            raise InputError(
                f"episode = {self.episode}: must be at least window = {self.window}, and shorter than "
                f"a record of {self.seconds:g} s"
            )

    @property
    def windows(self) -> int:
        """Windows after which sequences begin anew."""
        return self.episode // self.window
