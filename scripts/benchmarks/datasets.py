"""Benchmarks of datasets: rate on one and two cores, cost of logging, memory, file size, reading time."""

import dataclasses
import itertools
import multiprocessing
import resource
import shutil
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from scripts.benchmarks.harness import OnProgress, Result, in_turn, measurement, processor_time
from twin.dataset.episodes import make_episodes
from twin.dataset.files import make_files
from twin.dataset.recipe import Recipe
from twin.dataset.write import AT_ONCE, write_dataset
from twin.physics import simulate_batch
from twin.preset.preset import Preset
from twin.recording import read_episode

TURNS = 3  # of two workers and of one


@measurement("logging")
def logging(preset: Preset, amplitude: float) -> Result:
    """Measure the time of sensor, statistics, file and hash against that of the simulation alone.

    One batch of episodes of 60 s, simulated alone and made into files, in turn.
    """
    recipe = _recipe(preset, amplitude, AT_ONCE)
    pulls = [episode.pull for episode in make_episodes(recipe, recipe.keys) if episode is not None]
    with tempfile.TemporaryDirectory() as scratch:
        numbers = iter(range(100))

        def make() -> None:
            folder = Path(scratch) / str(next(numbers))
            folder.mkdir()
            make_files(recipe, recipe.keys, folder, {}, False)

        total, alone = in_turn(
            make, lambda: simulate_batch([preset] * len(pulls), pulls, recipe.sample_time_s, threads=1)
        )
    each, peer, bar = (total - alone) / len(pulls), alone / len(pulls), "< 0.15 times the simulation alone"
    return Result("logging", each, "s per simulated minute", bar, None, "the simulation alone", peer)


@measurement("dataset")
def dataset(preset: Preset, amplitude: float, episodes: int, progress: OnProgress) -> dict[str, Result]:
    """Measure rate, file size and reading time of episodes of 60 s, by two workers and by one in turn."""
    recipe = _recipe(preset, amplitude, episodes)
    with tempfile.TemporaryDirectory() as scratch:
        folder, turns = Path(scratch) / "data", itertools.count()

        def make(workers: int) -> None:
            turn = next(turns)
            shutil.rmtree(folder, ignore_errors=True)
            _write(recipe, folder, workers, lambda done, all_: progress(turn * all_ + done, 2 * TURNS * all_))

        # Starting the workers and describing the dataset is part of the work: nothing is warmed up.
        two, one = in_turn(lambda: make(2), lambda: make(1), TURNS, warm_up=False)
        paths = sorted(folder.glob("*.mcap"))
        size = sum(path.stat().st_size for path in paths)
        before = time.perf_counter()
        read = sum(len(read_episode(path).time) * recipe.sample_time_s for path in paths)
        reading = read / (time.perf_counter() - before)
    name = f"{episodes} episodes of 60 s by two workers, logging included"
    rates, bar, weight = (read / two, read / one), ">= 1.7 times one worker", size / 1e6 / (read / 60)
    return {
        "dataset_two_cores": Result(name, rates[0], "times real time", bar, None, "one worker", rates[1]),
        "dataset_size": Result("size of the files", weight, "MB per simulated minute"),
        "dataset_reading": Result("reading the files into arrays", reading, "times real time", ">= 100"),
    }


@measurement("dataset_reduced")
def by_the_reduced_twin(preset: Preset, amplitude: float, episodes: int) -> dict[str, Result]:
    """Measure the rate of episodes of 60 s made by the reduced twin, two workers, against MuJoCo's.

    Once by the clock on the wall and once by the processor time of all processes, which others of the machine
    hardly change.
    """
    recipe = _recipe(preset, amplitude, episodes)
    with tempfile.TemporaryDirectory() as scratch:
        numbers = itertools.count()

        def make(physics: str, count: int = episodes) -> tuple[float, float]:
            made = dataclasses.replace(recipe, physics=physics, episodes=count)
            wall, used = time.perf_counter(), processor_time()
            _write(made, Path(scratch) / str(next(numbers)), 2, lambda done, total: None)
            return time.perf_counter() - wall, processor_time() - used

        make("reduced", 1)  # what a process loads at its first dataset counts for neither
        taken = {physics: make(physics) for physics in ("reduced", "mujoco")}
    simulated, results = 60.0 * episodes, {}
    clocks = {"dataset_reduced": "wall time", "dataset_reduced_processor": "processor time"}
    for (key, clock), ours, theirs in zip(clocks.items(), *taken.values(), strict=True):
        name = f"{episodes} episodes of 60 s by the reduced twin, two workers, logging included, {clock}"
        rate, bar, peer = simulated / ours, ">= 3 times MuJoCo", "the twin in MuJoCo"
        results[key] = Result(name, rate, "times real time", bar, None, peer, simulated / theirs)
    return results


@measurement("memory")
def memory(preset: Preset, amplitude: float, many_episodes: int) -> Result:
    """Measure the peak memory of parent and worker over many episodes of 10 s, against 10 of them."""
    peaks = {}
    fresh = multiprocessing.get_context("spawn")
    for count in (10, many_episodes):
        with ProcessPoolExecutor(1, fresh) as alone:
            peaks[count] = alone.submit(_peak_memory, preset, amplitude, count).result()
    few, many = peaks[10], peaks[many_episodes]
    name, bar = f"memory of making {many_episodes} episodes", "< 1.1 times that of 10"
    return Result(name, many, "MB, parent and worker", bar, None, "10 episodes", few)


def _peak_memory(preset: Preset, amplitude: float, episodes: int) -> float:
    """Return the peak resident memory of this process and of its largest worker [MB]."""
    recipe = _recipe(preset, amplitude, episodes, seconds=10.0)
    with tempfile.TemporaryDirectory() as scratch:
        _write(recipe, Path(scratch), 2, lambda done, total: None)
    usages = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usages) / 1024  # Linux counts in KiB


def _write(recipe: Recipe, folder: Path, workers: int, on_progress: OnProgress) -> None:
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        write_dataset(recipe, folder, executor, workers=workers, on_progress=on_progress)


def _recipe(preset: Preset, amplitude: float, episodes: int, seconds: float = 60.0) -> Recipe:
    stroke = (-1e3 * amplitude, 1e3 * amplitude)
    return Recipe(preset, (stroke,), seconds=seconds, episodes=episodes)
