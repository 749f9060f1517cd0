"""Settings of the trainings on simulated twins."""

import dataclasses
from typing import Any, ClassVar, Self

from rl.options import TrainingOptions, share_of
from rl.twins.noises import STANDARD, check_families
from rl.twins.records import SAMPLE_TIME, STRIDES, STROKE_MM
from twin.errors import InputError
from twin.files.bounds import check_between
from twin.files.trained_schema import MOST_MEMBERS

SAMPLE_TIMES = tuple(stride * SAMPLE_TIME for stride in STRIDES)  # possible T [s]
MOST_WIDTH = 512  # of the memory of a network


@dataclasses.dataclass(frozen=True)
class SimulatedTraining:
    """Settings of a training on simulated twins."""

    # settings that are scaled where a training is to be longer or shorter, and the least of each
    lengths: ClassVar[dict[str, int]] = {"commands": 6, "interval_sequences": 64, "interval_updates": 1}

    commands: int = 90  # C, along which twins are simulated
    twins: int = 8  # K along each command, whose angle is estimated
    seconds: float = 40.0  # length of a record
    stroke_mm: tuple[float, float] = STROKE_MM  # that commands lie within, of any width and place
    episode: int = 300  # samples until all begin again, on other records
    interval_sequences: int = 1536  # that the width of the interval is learned from
    interval_updates: int = 1500  # gradient steps of that
    noises: tuple[str, ...] = STANDARD  # families of `rl.twins.noises` in the training
    sample_times: tuple[float, ...] = SAMPLE_TIMES  # T of the training, the most frequent first [s]
    seed: int = 0  # of everything that is drawn

    def __post_init__(self) -> None:
        check_families(self.noises)
        times = self.sample_times
        if not times or len(set(times)) < len(times) or not set(times) <= set(SAMPLE_TIMES):
            asked, valid = (", ".join(f"{time:g}" for time in of) for of in (times, SAMPLE_TIMES))
            raise InputError(f"sample times {asked or '(none)'} s: valid are {valid}, each once")
        low, high = self.stroke_mm
        if not low < high:
            raise InputError(f"stroke [{low:g}, {high:g}] mm: must rise")
        if not 1 <= self.episode <= int(self.seconds / (SAMPLE_TIME * STRIDES[0])) - 1:
            raise InputError(
                f"episode = {self.episode}: must be positive, and shorter than a record of {self.seconds:g} s"
            )

    @property
    def strides(self) -> tuple[int, ...]:
        """Sample times of the training, in units of that of the records."""
        return tuple(STRIDES[SAMPLE_TIMES.index(time)] for time in self.sample_times)

    def scaled(self, options: TrainingOptions) -> Self:
        """Return the settings of a training as long as options ask for, relative to the paper's episodes."""
        scaled: dict[str, Any] = {
            name: max(share_of(getattr(self, name), options), least) for name, least in self.lengths.items()
        }
        return dataclasses.replace(self, **scaled, seed=options.seed)


@dataclasses.dataclass(frozen=True)
class NetworkTraining(SimulatedTraining):
    """Settings of the training of RAM (memory), or of a rival of RAM (twins)."""

    lengths: ClassVar[dict[str, int]] = SimulatedTraining.lengths | {"updates": 1}

    width: int = 48  # outputs of its memory, or channels of it
    sequences: int = 128  # with their own noise, that run side by side
    window: int = 50  # samples that an error is traced back over
    updates: int = 1800  # gradient steps through the filter, one per window
    learning_rate: float = 1e-2  # of Adam through the filter at the start; it falls to zero along a cosine
    linear_penalty: float = 0.3  # weight of what the policy does where doing nothing is best
    bias_weight: float = 0.05  # weight of the loss of the mean of the noise next to the error of the estimate

    def __post_init__(self) -> None:
        super().__post_init__()
        check_between("width", self.width, 1, MOST_WIDTH)
        check_between("window", self.window, 1, self.episode)

    @property
    def windows(self) -> int:
        """Windows after which sequences begin again."""
        return self.episode // self.window


@dataclasses.dataclass(frozen=True)
class TwinsTraining(SimulatedTraining):
    """Settings of the training of RAM (twins)."""

    lengths: ClassVar[dict[str, int]] = SimulatedTraining.lengths | {
        "noise_model_sequences": 64,
        "noise_model_updates": 1,
    }

    members: int = 40  # M, twins that the prediction is made of
    moving: int = 16  # how many of them are in a sheath that moves
    rank: int = 28  # r, directions among them that are estimated
    with_error: bool = True  # whether what no member does is estimated
    with_classifier: bool = True  # whether there are noise models to choose among; without them it is normal
    noise_model_sequences: int = 8192  # of noise that the noise models are learned from first
    noise_model_updates: int = 1500  # gradient steps of that
    noise_model_rate: float = 3e-2  # step of Adam of that at the start; it falls to zero along a cosine

    def __post_init__(self) -> None:
        super().__post_init__()
        check_between("members", self.members, 2, MOST_MEMBERS)
        check_between("moving", self.moving, 0, self.members)
        check_between("rank", self.rank, 1, self.members)

    @property
    def known_noises(self) -> tuple[str, ...]:
        """Families whose noise models there are to choose among."""
        return self.noises if self.with_classifier else ("gaussian",)
