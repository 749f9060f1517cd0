"""Comparison of controllers: models, tuning and trials, side by side on workers; a stopped one is resumed."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gmean, qmc

from twin import __version__
from twin.control.conditions import ControlCondition, ControlSettings
from twin.control.controller import TRAINED, ControlKnowledge, ControllerSpec, Setting, find_controllers
from twin.control.results import MEASURES, Comparison, ControlResult, measures_of
from twin.control.trial import ControlCase, ControlTrial, run_trial
from twin.errors import DivergedError, InputError
from twin.estimation.deployment import Deployment
from twin.files.state_file import read_state, state_key, write_state

Array = NDArray[np.float64]
AROUND_THE_BEST = 0.25  # share of the settings that are drawn about the best of the others
ABOUT_AS_GOOD = 1.05
"""Error, in units of the least, within which the setting with the least travel is taken: travel is wear."""
NARROWER = 0.15  # half width of the range about the best, as a share of the whole


class Tuned(NamedTuple):
    """Result of a search: the best settings, their error, and how many were tried."""

    settings: dict[str, float]
    rmse_deg: float  # geometric mean of the cases of the tuning [deg]
    tried: int


def tune(
    name: str,
    settings: Mapping[str, Setting],
    cases: Sequence[tuple[ControlKnowledge, ControlCase]],
    candidates: int,
    seed: int,
) -> Tuned:
    """Search the settings of the controller of a name."""
    if not settings:
        return Tuned({}, _trials(name, {}, cases)[0], 1)
    values = np.array([*settings.values()]).T
    logarithmic = values[1] > 0
    default, low, high = np.log(values, out=values.copy(), where=logarithmic)

    def named(at: Array) -> dict[str, float]:
        return dict(zip(settings, np.exp(at, out=at.copy(), where=logarithmic).tolist(), strict=True))

    early = max(candidates - math.ceil(AROUND_THE_BEST * candidates), 1)
    tried = [default, *(low + point * (high - low) for point in _points(len(low), early - 1, seed))]
    found = [_trials(name, named(at), cases) for at in tried]
    best = tried[_best(found)]
    for point in _points(len(low), candidates - early, seed + 1):
        about = np.clip(best + (2 * point - 1) * NARROWER * (high - low), low, high)
        tried.append(about)
        found.append(_trials(name, named(about), cases))
    least = _best(found)
    return Tuned(named(tried[least]), found[least][0], len(tried))


def _best(found: Sequence[tuple[float, float]]) -> int:
    """Return the place of the least travel among those with about the least error."""
    error, travel = np.array(found).T
    return int(np.argmin(np.where(error <= ABOUT_AS_GOOD * error.min(), travel, np.inf)))


def _points(dimensions: int, count: int, seed: int) -> Array:
    if count < 1:
        return np.empty((0, dimensions))
    points: Array = qmc.Sobol(dimensions, seed=seed).random_base2(math.ceil(math.log2(count)))[:count]
    return points


def _trials(
    name: str, settings: Mapping[str, float], cases: Sequence[tuple[ControlKnowledge, ControlCase]]
) -> tuple[float, float]:
    """Return the geometric mean of the errors [deg] and the travel [mm] of all trials of a setting."""
    errors, travel = [], 0.0
    for knowledge, case in cases:
        trial_knowledge = dataclasses.replace(knowledge, settings={**knowledge.settings, name: settings})
        try:
            trial = run_trial(name, trial_knowledge, case)
        except DivergedError:
            return math.inf, math.inf
        errors.append(trial.rmse_deg)
        travel += trial.travel_mm
    return float(gmean(errors)), travel


OnProgress = Callable[[int, int, str], None]
PARTS = "parts"
"""Folder of finished results: one file for each search and for each controller under each condition."""
_KIND = "part of a comparison of controllers"
_TRACE = ("reference_deg", "pull_mm", "truth_deg", "measured_deg", "estimate_deg")
Arrays = dict[str, Array]
Sensor = tuple[float, float]  # R [deg^2] and T [s]
Job = tuple[Any, str]  # sensor or place of a condition, and name of a controller
Settings = dict[str, dict[str, float]]  # what was tuned, by controller and name


def compare(
    settings: ControlSettings,
    conditions: Sequence[ControlCondition],
    controllers: Sequence[str],
    folder: Path,
    executor: Executor,
    on_progress: OnProgress,
) -> Comparison:
    """Tune and run controllers under conditions."""
    specs = find_controllers(controllers)
    sensors = list(dict.fromkeys(condition.sensor for condition in conditions))
    compared = [(place, spec) for spec in specs for place in places_of(spec, settings, conditions)]
    met = {(conditions[place].sensor, spec.name) for place, spec in compared}
    searches = [(sensor, spec) for sensor in sensors for spec in specs if (sensor, spec.name) in met]
    total = len(searches) + len(compared)
    on_progress(0, total, "models")
    deployments = list(executor.map(settings.find_deployment, settings.strokes_mm))
    parts = _Parts(folder / PARTS, settings, deployments, executor, on_progress, total)
    tuned: dict[Sensor, Settings] = {sensor: {} for sensor in sensors}
    searched = []
    for falls_back in (False, True):  # a controller with a fallback takes the tuned settings of that
        jobs = {}
        for sensor, spec in searches:
            if bool(spec.falls_back_on) is falls_back:
                name = f"tuned_{spec.name}_{sensor[0]:g}_{sensor[1]:g}"
                jobs[sensor, spec.name] = (name, sensor, tuned[sensor])
        for (sensor, name), arrays in parts.run(_search, jobs).items():
            (spec,) = find_controllers([name])
            names = spec.searched(settings.preview_s)
            found = dict(zip(names, arrays["settings"].tolist(), strict=True))
            tuned[sensor] = tuned[sensor] | {name: found}
            searched.append(
                {
                    "controller": name,
                    "noise_variance_deg2": sensor[0],
                    "sample_time_s": sensor[1],
                    "settings": found,
                    "rmse_deg": float(arrays["rmse_deg"][0]),
                    "tried": int(arrays["tried"][0]),
                }
            )
    trials = {}
    for place, spec in sorted(compared, key=lambda one: (one[0], not one[1].needs)):  # the longest first
        condition = conditions[place]
        name = f"trials_{spec.name}_{condition.slug}"
        trials[place, spec.name] = (name, condition, tuned[condition.sensor])
    done = parts.run(_run, trials)
    results, shown = [], {}
    for place, condition in enumerate(conditions):
        for name in [spec.name for spec in specs if (place, spec.name) in done]:
            arrays, mine = done[place, name], tuned[condition.sensor][name]
            measures = {measure: arrays[measure] for measure in MEASURES}
            results.append(ControlResult(name, condition, settings.strokes_mm, measures, mine))
            if place == 0:
                unknown = np.full(len(arrays["truth_deg"]), np.nan)
                traces = {of: arrays.get(of, unknown) for of in _TRACE}
                shown[name] = ControlTrial(**traces, fell_back=unknown > 0, sample_time=condition.sample_time)
    return Comparison(results, shown, searched)


class _Parts:
    """Parts of a comparison: existing ones are read, the others are computed on workers and kept."""

    def __init__(
        self,
        folder: Path,
        settings: ControlSettings,
        deployments: list[Deployment],
        executor: Executor,
        on_progress: OnProgress,
        total: int,
    ) -> None:
        self._folder, self._executor, self._on_progress = folder, executor, on_progress
        self._total, self._done = total, 0
        self._of_all = settings, deployments
        self._key = [__version__, settings.to_dict(), [of.to_dict() for of in deployments]]
        folder.mkdir(parents=True, exist_ok=True)

    def run(
        self, work: Callable[..., Arrays], jobs: Mapping[Job, tuple[str, Any, Settings]]
    ) -> dict[Job, Arrays]:
        """Return the results of jobs, each kept as soon as it is complete."""
        found, waiting = {}, {}
        for job, (part, where, tuned) in jobs.items():
            (spec,) = find_controllers([job[1]])
            used = {name: tuned[name] for name in (spec.name, spec.falls_back_on) if name in tuned}
            path, key = self._folder / f"{part}.state", state_key(*self._key, part, repr((where, used)))
            there = read_state(path, _KIND, key)
            if there is not None:
                found[job] = there
            else:
                waiting[self._executor.submit(work, job[1], where, used, *self._of_all)] = job, path, key
        self._done += len(found)
        for future in as_completed(waiting):
            job, path, key = waiting[future]
            found[job] = future.result()
            write_state(path, _KIND, key, found[job])
            self._done += 1
            self._on_progress(self._done, self._total, path.stem)
        self._on_progress(self._done, self._total, "")
        return {job: found[job] for job in jobs}


def _knowledge(
    settings: ControlSettings, sensor: Sensor, deployments: Sequence[Deployment]
) -> list[ControlKnowledge]:
    pairs = zip(settings.strokes_mm, deployments, strict=True)
    return [settings.knowledge(stroke, sensor, deployment) for stroke, deployment in pairs]


def _search(
    name: str, sensor: Sensor, others: Settings, settings: ControlSettings, deployments: list[Deployment]
) -> Arrays:
    (spec,) = find_controllers([name])
    cases = [
        (dataclasses.replace(known, settings=others), case)
        for known in _knowledge(settings, sensor, deployments)
        for case in settings.tuning_cases(known)
    ]
    searched = spec.searched(settings.preview_s)
    tuned = tune(name, searched, cases, settings.candidates, settings.seed)
    values = np.array(list(tuned.settings.values()))
    return {"settings": values, "rmse_deg": np.array([tuned.rmse_deg]), "tried": np.array([tuned.tried])}


def _run(
    name: str,
    condition: ControlCondition,
    tuned: Settings,
    settings: ControlSettings,
    deployments: list[Deployment],
) -> Arrays:
    trials = []
    for known in _knowledge(settings, condition.sensor, deployments):
        known = dataclasses.replace(known, settings=tuned)
        trials += [run_trial(name, known, case) for case in settings.cases(condition, known)]
    shape = len(settings.strokes_mm), settings.twins, len(condition.signals)
    columns = np.array([measures_of(trial) for trial in trials]).T
    arrays = {measure: of.reshape(shape) for measure, of in zip(MEASURES, columns, strict=True)}
    traces = {of: getattr(trials[0], of) for of in _TRACE}
    return arrays | {of: values for of, values in traces.items() if np.isfinite(values).all()}


def specs_of(settings: ControlSettings, names: Sequence[str]) -> tuple[ControllerSpec, ...]:
    """Return the controllers of these names; `all` is those that can run with what is given."""
    found = []
    for spec in find_controllers(names):
        if not spec.needs or getattr(settings, spec.needs) is not None:
            found.append(spec)
        elif spec.name in names:
            of = f"a trained file of {TRAINED[spec.needs]}"
            raise InputError(f"controller {spec.name!r} runs on {of}: none is given")
    return tuple(found)


def places_of(
    spec: ControllerSpec, settings: ControlSettings, conditions: Sequence[ControlCondition]
) -> list[int]:
    """Return which of the conditions a controller runs under.

    One whose file is for one sample time is left out of others; under the first condition it must run.
    """
    places = range(len(conditions))
    path = getattr(settings, spec.needs) if spec.needs else None
    if spec.sample_time_of is None or path is None:
        return list(places)
    trained = spec.sample_time_of(path)
    return [place for place in places if not place or math.isclose(conditions[place].sample_time, trained)]
