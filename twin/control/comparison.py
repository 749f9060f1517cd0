"""Comparison of controllers: models, tuning and trials, side by side on workers; a stopped one goes on."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gmean, qmc

from twin import __version__
from twin.control.conditions import ControlCondition, ControlSettings
from twin.control.controller import TRAINED, ControlKnowledge, ControllerSpec, find_controllers
from twin.control.results import MEASURES, Comparison, ControlResult, measures_of
from twin.control.trial import ControlCase, ControlTrial, run_trial
from twin.errors import DivergedError, InputError
from twin.estimation.deployment import Deployment
from twin.files.state_file import read_state, state_key, write_state

Array = NDArray[np.float64]
AROUND_THE_BEST = 0.25
"""Share of the settings that are drawn about the best of the others."""
ABOUT_AS_GOOD = 1.05
"""Error, in units of the least, within which the setting with the least travel is taken: travel is wear."""
NARROWER = 0.15
"""Half width of the range about the best, as a share of the whole."""


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Result of a search.

    Attributes:
        settings: the best, by name.
        rmse_deg: its error, geometric mean of the cases of the tuning [deg].
        tried: how many settings were.
    """

    settings: dict[str, float]
    rmse_deg: float
    tried: int


def tune(
    spec: ControllerSpec, cases: Sequence[tuple[ControlKnowledge, ControlCase]], candidates: int, seed: int
) -> Tuned:
    """Search the settings of a controller."""
    names = list(spec.settings)
    if not names:
        return Tuned({}, _trials(spec, {}, cases)[0], 1)
    low, high = (
        np.log([getattr(setting, end) for setting in spec.settings.values()]) for end in ("low", "high")
    )
    late = math.ceil(AROUND_THE_BEST * candidates)
    early = max(candidates - late, 1)
    default = np.log([setting.default for setting in spec.settings.values()])
    tried = [default, *(low + point * (high - low) for point in _points(len(names), early - 1, seed))]
    found = [_trials(spec, _named(names, values), cases) for values in tried]
    best = tried[_best(found)]
    for point in _points(len(names), candidates - early, seed + 1):
        about = np.clip(best + (2 * point - 1) * NARROWER * (high - low), low, high)
        tried.append(about)
        found.append(_trials(spec, _named(names, about), cases))
    least = _best(found)
    return Tuned(_named(names, tried[least]), found[least][0], len(tried))


def _best(found: Sequence[tuple[float, float]]) -> int:
    """Return the place of the least travel among those with about the least error."""
    error, travel = np.array(found).T
    return int(np.argmin(np.where(error <= ABOUT_AS_GOOD * error.min(), travel, np.inf)))


def _points(dimensions: int, count: int, seed: int) -> Array:
    if count < 1:
        return np.empty((0, dimensions))
    sequence = qmc.Sobol(dimensions, seed=seed)
    points: Array = sequence.random_base2(math.ceil(math.log2(count)) if count > 1 else 0)[:count]
    return points


def _named(names: Sequence[str], logarithms: Array) -> dict[str, float]:
    return dict(zip(names, np.exp(logarithms).tolist(), strict=True))


def _trials(
    spec: ControllerSpec, settings: Mapping[str, float], cases: Sequence[tuple[ControlKnowledge, ControlCase]]
) -> tuple[float, float]:
    """Return the geometric mean of the errors [deg] and the travel [mm] of all trials of a setting."""
    errors, travel = [], 0.0
    for knowledge, case in cases:
        trial_knowledge = dataclasses.replace(knowledge, settings={**knowledge.settings, spec.name: settings})
        try:
            trial = run_trial(spec.name, trial_knowledge, case)
        except DivergedError:
            return math.inf, math.inf
        errors.append(trial.rmse_deg)
        travel += trial.travel_mm
    return float(gmean(errors)), travel


OnProgress = Callable[[int, int, str], None]
PARTS = "parts"
"""Folder of what is done: one file for each search and for each controller under each condition."""
_KIND = "part of a comparison of controllers"
_TRACE = ("reference_deg", "pull_mm", "truth_deg", "measured_deg", "estimate_deg")
Arrays = dict[str, Array]


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
    parts = _Parts(folder / PARTS, settings, executor, on_progress)
    parts.total = len(searches) + len(compared)
    on_progress(0, parts.total, "models")
    deployments = list(executor.map(ControlSettings.find_deployment, *_pairs(settings)))
    tuned: dict[tuple[float, float], dict[str, dict[str, float]]] = {sensor: {} for sensor in sensors}
    searched = []
    for falls_back in (False, True):  # what falls back on another law takes what was tuned for that
        begun = {
            (sensor, spec.name): parts.start(
                f"tuned_{spec.name}_{_sensor_name(sensor)}",
                _search,
                spec.name,
                sensor,
                _of(spec, tuned[sensor]),
                settings,
                deployments,
            )
            for sensor, spec in searches
            if bool(spec.falls_back_on) is falls_back
        }
        for (sensor, name), arrays in parts.finish(begun).items():
            found = tuned[sensor][name] = _settings_of(arrays, name)
            searched.append(_search_entry(name, sensor, found, arrays))
    runs = {}
    for place, spec in sorted(compared, key=lambda one: (one[0], not one[1].needs)):  # the longest first
        condition = conditions[place]
        runs[place, spec.name] = parts.start(
            f"trials_{spec.name}_{condition.slug}",
            _run,
            spec.name,
            condition,
            _of(spec, tuned[condition.sensor]),
            settings,
            deployments,
        )
    done = parts.finish(runs)
    results, shown = [], {}
    for (place, name), arrays in done.items():
        condition = conditions[place]
        measures = {measure: arrays[measure] for measure in MEASURES}
        mine = tuned[condition.sensor][name]
        results.append(ControlResult(name, condition, settings.strokes_mm, measures, mine))
        if place == 0:
            shown[name] = _trial_of(arrays, condition.sample_time)
    order = [spec.name for spec in specs]
    results.sort(key=lambda result: (conditions.index(result.condition), order.index(result.controller)))
    shown = {name: shown[name] for name in order}
    return Comparison(results, shown, searched)


def _pairs(settings: ControlSettings) -> tuple[list[ControlSettings], list[tuple[float, float]]]:
    return [settings] * len(settings.strokes_mm), list(settings.strokes_mm)


class _Parts:
    """Parts of a comparison: what is there is read, the rest is made on workers and kept."""

    def __init__(
        self, folder: Path, settings: ControlSettings, executor: Executor, on_progress: OnProgress
    ) -> None:
        self.total = self._done = 0
        self._folder, self._executor, self._on_progress = folder, executor, on_progress
        self._of_all = [__version__, settings.to_dict()]
        folder.mkdir(parents=True, exist_ok=True)

    def start(
        self, name: str, work: Callable[..., Arrays], *given: Any
    ) -> tuple[Path, str, Arrays | None, Future[Arrays] | None]:
        """Begin a part, or read it; it belongs to the settings and to what it is given."""
        path = self._folder / f"{name}.state"
        key = state_key(*self._of_all, name, repr([_plain(value) for value in given]))
        there = read_state(path, _KIND, key)
        return path, key, there, None if there is not None else self._executor.submit(work, *given)

    def finish(
        self, begun: dict[Any, tuple[Path, str, Arrays | None, Future[Arrays] | None]]
    ) -> dict[Any, Arrays]:
        """Wait for parts and keep them, each as soon as it is there."""
        found = {key: there for key, (_, _, there, _) in begun.items() if there is not None}
        self._done += len(found)
        waiting = {future: key for key, (_, _, _, future) in begun.items() if future is not None}
        for future in as_completed(waiting):
            key = waiting[future]
            path, sign, _, _ = begun[key]
            found[key] = future.result()
            write_state(path, _KIND, sign, found[key])
            self._done += 1
            self._on_progress(self._done, self.total, path.stem)
        self._on_progress(self._done, self.total, "")
        return {key: found[key] for key in begun}


def _plain(value: Any) -> Any:
    """Return an argument of a part as plain values; settings are in every key."""
    if isinstance(value, ControlSettings):
        return "settings"
    if isinstance(value, list):
        return [of.to_dict() if isinstance(of, Deployment) else of for of in value]
    return value


def _knowledge(
    settings: ControlSettings, sensor: tuple[float, float], deployments: Sequence[Deployment]
) -> list[ControlKnowledge]:
    return [
        settings.knowledge(stroke, sensor, deployment)
        for stroke, deployment in zip(settings.strokes_mm, deployments, strict=True)
    ]


def _search(
    name: str,
    sensor: tuple[float, float],
    others: dict[str, dict[str, float]],
    settings: ControlSettings,
    deployments: list[Deployment],
) -> Arrays:
    """Tune one controller for one sensor, with what was tuned for others."""
    (spec,) = find_controllers([name])
    cases = [
        (dataclasses.replace(known, settings=others), case)
        for known in _knowledge(settings, sensor, deployments)
        for case in settings.tuning_cases(known)
    ]
    tuned = tune(spec, cases, settings.candidates, settings.seed)
    values = np.array(list(tuned.settings.values()))
    return {"settings": values, "rmse_deg": np.array([tuned.rmse_deg]), "tried": np.array([tuned.tried])}


def _of(spec: ControllerSpec, tuned: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """Return what was tuned for a controller and for its fallback, of all that was."""
    return {name: tuned[name] for name in (spec.name, spec.falls_back_on) if name in tuned}


def _sensor_name(sensor: tuple[float, float]) -> str:
    return f"{sensor[0]:g}_{sensor[1]:g}"


def _search_entry(
    name: str, sensor: tuple[float, float], found: dict[str, float], arrays: Arrays
) -> dict[str, Any]:
    """Return the entry of a search in `control.json`."""
    return {
        "controller": name,
        "noise_variance_deg2": sensor[0],
        "sample_time_s": sensor[1],
        "settings": found,
        "rmse_deg": float(arrays["rmse_deg"][0]),
        "tried": int(arrays["tried"][0]),
    }


def _settings_of(arrays: Arrays, name: str) -> dict[str, float]:
    (spec,) = find_controllers([name])
    return dict(zip(spec.settings, arrays["settings"].tolist(), strict=True))


def _run(
    name: str,
    condition: ControlCondition,
    tuned: dict[str, dict[str, float]],
    settings: ControlSettings,
    deployments: list[Deployment],
) -> Arrays:
    """Run one controller under one condition on all strokes, twins and signals."""
    rows, first = [], None
    for known in _knowledge(settings, condition.sensor, deployments):
        known = dataclasses.replace(known, settings=tuned)
        for case in settings.cases(condition, known.stroke_mm, known):
            trial = run_trial(name, known, case)
            first = first or trial
            rows.append(measures_of(trial))
    shape = len(settings.strokes_mm), settings.twins, len(condition.signals)
    columns = np.array(rows).T
    arrays = {measure: of.reshape(shape) for measure, of in zip(MEASURES, columns, strict=True)}
    assert first is not None
    traces = {of: getattr(first, of) for of in _TRACE}
    return arrays | {of: values for of, values in traces.items() if np.isfinite(values).all()}


def _trial_of(arrays: Arrays, sample_time: float) -> ControlTrial:
    unknown = np.full(len(arrays["truth_deg"]), np.nan)
    traces = {name: arrays.get(name, unknown) for name in _TRACE}
    return ControlTrial(**traces, fell_back=np.zeros(len(unknown), dtype=bool), sample_time=sample_time)


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
