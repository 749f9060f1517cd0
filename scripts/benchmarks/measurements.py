"""All long measurements by name, how they are run one after the other, and the table of their results."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tabulate import tabulate

from scripts.benchmarks import datasets, estimation, physics, pictures, reduced, speed
from scripts.benchmarks.harness import Result
from twin.errors import InputError
from twin.files.bounds import check_between
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import load_ranges

OnProgress = Callable[[int, int], None]


LARGEST_AMPLITUDE = 0.05
"""Largest amplitude of a command, more than any pulley pulls [m]."""
MOST = {
    "cycles": 1_000_000,
    "draws": 1_000_000,
    "pairs": 1_000_000,
    "known": 10_000,
    "steps": 100_000_000,
    "episodes": 10_000,
    "many_episodes": 10_000,
    "frames": 10_000_000,
}
"""Largest number of each."""


@dataclasses.dataclass(frozen=True)
class Size:
    """Choice of measurements and their sizes.

    Attributes:
        preset: name of the endoscope, or path of its file.
        amplitude: of the commands [m].
        cycles: random closed cycles.
        draws: endoscopes drawn from the randomisation ranges.
        pairs: of them that both twins simulate.
        known: endoscopes that are calibrated on logs of their own.
        steps: samples over which the covariances of the Kalman filters are watched.
        episodes: of 60 s, of the dataset that is made, weighed and read.
        many_episodes: of 10 s, while the memory is watched.
        frames: pairs of pictures of a stereo sensor, while instruments pass before it.
    """

    preset: str | Path = "ureteroscope"
    amplitude: float = 4e-3
    cycles: int = 1000
    draws: int = 10_000
    pairs: int = 200
    known: int = 20
    steps: int = 1_000_000
    episodes: int = 64
    many_episodes: int = 1000
    frames: int = 10_000

    def __post_init__(self) -> None:
        """Refuse what measures nothing, or never ends."""
        for field in dataclasses.fields(self)[1:]:
            if not getattr(self, field.name) > 0:
                raise InputError(f"{field.name} = {getattr(self, field.name)}: must be positive")
        if not self.amplitude <= LARGEST_AMPLITUDE:
            raise InputError(
                f"amplitude = {self.amplitude * 1e3:g} mm: must be at most {LARGEST_AMPLITUDE * 1e3:g} mm"
            )
        for name in ("cycles", "draws", "pairs", "known", "steps", "episodes", "many_episodes", "frames"):
            check_between(name, getattr(self, name), 1, MOST[name])


Measurement = Callable[[Preset, Size, OnProgress], Result | dict[str, Result]]


def _short(measure: Callable[[Preset, float], Result | dict[str, Result]]) -> Measurement:
    return lambda preset, size, _: measure(preset, size.amplitude)


MEASUREMENTS: dict[str, Measurement] = {
    "rate_independence": _short(physics.rate_independence),
    "hold": _short(physics.hold),
    "time_step": _short(physics.time_step),
    "capstan": _short(physics.capstan),
    "return_point": _short(physics.return_point),
    "no_friction": _short(physics.no_friction),
    "vertebrae": _short(physics.vertebrae),
    "speed_one_core": _short(speed.one_core),
    "speed_two_threads": _short(speed.two_threads),
    "cost_of_vertebrae": _short(speed.cost_of_vertebrae),
    "fidelities": lambda preset, size, _: physics.fidelities(preset, size.amplitude),
    "rendering": _short(pictures.pictures),
    "logging": _short(datasets.logging),
    "identification": _short(estimation.against_one_at_a_time),
    "identification_plain": _short(estimation.against_plain_numbers),
    "cost_of_seeds": _short(speed.cost_of_seeds),
    "cost_of_samples": _short(speed.cost_of_samples),
    "start": lambda _, __, progress: speed.start(progress),
    "closed_cycles": lambda preset, size, progress: physics.closed_cycles(
        preset, size.amplitude, size.cycles, progress
    ),
    "random_draws": lambda preset, size, progress: physics.random_draws(
        preset, load_ranges(size.preset), size.amplitude, size.draws, progress
    ),
    "covariances": lambda _, size, progress: estimation.covariances(size.steps, progress),
    "dataset": lambda preset, size, progress: datasets.dataset(
        preset, size.amplitude, size.episodes, progress
    ),
    "dataset_reduced": lambda preset, size, _: datasets.by_the_reduced_twin(
        preset, size.amplitude, size.episodes
    ),
    "reduced": lambda preset, size, progress: reduced.agreement(
        preset, load_ranges(size.preset), size.amplitude, size.pairs, progress
    ),
    "reduced_fine": lambda preset, size, _: reduced.fine(preset, size.amplitude),
    "reduced_speed": _short(reduced.speed),
    "reduced_online": lambda preset, size, _: reduced.online(
        preset, load_ranges(size.preset), size.amplitude
    ),
    "reduced_draws": lambda preset, size, progress: reduced.draws(
        preset, load_ranges(size.preset), size.amplitude, size.draws, progress
    ),
    "reduced_inverse": lambda preset, size, _: reduced.inverse(
        preset, load_ranges(size.preset), size.amplitude
    ),
    "reduced_start": lambda preset, _, __: reduced.start(preset),
    "recovery": lambda preset, size, progress: physics.recovered(
        preset, size.amplitude, size.known, progress
    ),
    "stereo": lambda preset, _, progress: pictures.accuracy(preset, progress),
    "stereo_occlusions": lambda preset, size, progress: pictures.occlusions(preset, size.frames, progress),
    "memory": lambda preset, size, _: datasets.memory(preset, size.amplitude, size.many_episodes),
}
"""Each measurement by its name: a result, or several."""
DRAWN = {"random_draws", "reduced", "reduced_online", "reduced_draws", "reduced_inverse"}
"""Measurements that draw endoscopes from the preset's ranges."""


def check_measurements(
    size: Size, names: Sequence[str], table: Mapping[str, Measurement] = MEASUREMENTS
) -> None:
    """Refuse, before any work, what cannot be measured."""
    for name in names:
        if name not in table:
            raise InputError(f"unknown measurement {name!r}; valid: {', '.join(table)}")
    load_preset(size.preset)
    if DRAWN.intersection(names):
        load_ranges(size.preset)


def measure(
    size: Size,
    names: Sequence[str],
    progress: Callable[[str], OnProgress],
    table: Mapping[str, Measurement] = MEASUREMENTS,
) -> dict[str, Result]:
    """Run measurements one after the other and return their results by name."""
    check_measurements(size, names, table)
    preset = load_preset(size.preset)
    results: dict[str, Result] = {}
    for name in names:
        result = table[name](preset, size, progress(name))
        results |= result if isinstance(result, dict) else {name: result}
    return results


def results_table(preset: str, results: Mapping[str, Result]) -> str:
    """Return the results as a Markdown table."""
    rows = []
    for result in results.values():
        ratio = "" if result.ratio is None else f"{result.ratio:.3g} times {result.peer}"
        holds = "yes" if result.holds else "no"
        rows.append([result.name, f"{result.value:.3g} {result.unit}", ratio, result.bar, holds])
    headers = ["measurement", "figure", "ratio in the same run", "bar", "holds"]
    table = tabulate(rows, headers=headers, tablefmt="github")
    return f"Preset `{preset}`, by `endotwin benchmark`.\n\n{table}\n"
