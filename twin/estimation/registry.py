"""Registry of estimators: each is declared once, in its own file; `twin.estimation.methods` presents them.

A new estimator is one new file in this package, or below it, that calls `register_method`, and one row in
that table. A Python file of a user (`--method-file`) needs no row. This module loads nothing but Python.
"""

import dataclasses
import functools
import importlib
import pkgutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.errors import InputError
from twin.estimation.methods import METHODS, UNLISTED, Presentation
from twin.estimation.methods import Style as Style
from twin.files.program import run_program
from twin.files.shown import suggestion

if TYPE_CHECKING:
    from twin.estimation.estimator import Estimator
    from twin.estimation.knowledge import CaseEstimator, Knowledge, TrainingFit
    from twin.estimation.learned.trained_file import TrainedFile


GIVEN = {
    "R": "the variance of the noise",
    "zero": "how well the mean of the sensor's errors is known: their standard deviation, not their sign",
    "bound": "the largest magnitude of the noise",
    "law": "the density of the noise: its family and its parameters; its mean too, without *zero*",
    "families": "the families that the law may be of",
    "ranges": "the twins of a preset, and the ranges that the endoscopes under test are drawn from",
    "past": "that a session starts at rest, and the command since then",
    "truth": "the true angle: an oracle",
}
"""What a method may be given beyond records of one endoscope, the command and the measurements."""


@dataclasses.dataclass(frozen=True)
class Training:
    """Training of a learned method, as the command line and a run folder name it."""

    agent: str  # word of `endotwin train --agent`
    file: str  # name of the trained file in a run folder
    load: "Callable[[TrainedFile], Estimator[Any]]"  # returns the estimator of such a file
    purpose: str  # a few words for the help of the command line
    same_filter: bool = False  # whether it runs with the very filter that it was trained with, and no other
    on_twins: bool = False  # trained on simulated twins of a preset, without records, for any T


@dataclasses.dataclass(frozen=True)
class MethodSpec:
    """Declaration of one method: how it is built, and from what.

    Attributes:
        name: in tables, figures and files.
        build: makes the estimator, or a function of a complete `Case`, from what is known before the test.
        given: what it knows, words of `GIVEN`.
        models: names of the identified models of hysteresis that it needs.
        fits: numbers fitted to the training records that it needs.
        records: whether it needs the training records themselves.
        wire_offset: whether it needs the smallest wire offset that a twin may have.
        ensembles: whether it needs ensembles of twins along the test's commands.
        needs_density: whether it needs the density of the noise, which is unknown for a recorded noise and a
            faulty sensor.
        training: how it is trained; None for what is not learned.
        trained_as: agent whose trained file it runs on; that of `training`, if not given.
        oracle: whether it is shown the truth: such a row is labelled, and no deployable result.
    """

    name: str
    build: "Callable[[Knowledge], Estimator[Any] | CaseEstimator]"
    given: tuple[str, ...]
    models: tuple[str, ...] = ()
    fits: "tuple[TrainingFit, ...]" = ()
    records: bool = False
    wire_offset: bool = False
    ensembles: bool = False
    needs_density: bool = False
    training: Training | None = None
    trained_as: str | None = None
    oracle: bool = False

    @property
    def knows(self) -> str:
        """What it knows, in a few words."""
        return ", ".join(self.given) or "nothing"

    @property
    def agent(self) -> str | None:
        """Agent whose trained file it runs on; None for what is not learned."""
        return self.training.agent if self.training else self.trained_as

    @property
    def presentation(self) -> Presentation:
        """Its row of the table of methods."""
        return METHODS.get(self.name, UNLISTED)

    def unmet_requirements(self, knowledge: "Knowledge") -> list[str]:
        """Return what it needs and is not known, in words; its fits are found from the records."""
        unmet = [f"the model {model}" for model in self.models if model not in knowledge.models]
        if (self.records or self.fits) and not knowledge.records:
            unmet.append("training records")
        if self.wire_offset and knowledge.smallest_wire_offset is None:
            unmet.append("the ranges of a preset")
        if self.ensembles and not knowledge.ensembles:
            unmet.append("ensembles of twins")
        if self.agent is not None and self.agent not in knowledge.trained:
            source = "" if find_training(self.agent).on_twins else ", or training records"
            unmet.append(f"a trained file of {self.agent}{source}")
        return unmet

    def is_ready(self, knowledge: "Knowledge") -> bool:
        """Return whether all that it needs is known."""
        return not self.unmet_requirements(knowledge)


_SPECS: dict[str, MethodSpec] = {}
_LOADED: dict[str, list[str]] = {}  # names of the methods of each method file that was run, by its module


def register_method(spec: MethodSpec) -> MethodSpec:
    """Add a method and return it; raises `ValueError` if its name or its agent is taken."""
    if spec.name in _SPECS:
        raise InputError(f"method {spec.name!r} is registered already")
    agents = {known.training.agent for known in _SPECS.values() if known.training}
    if spec.training and spec.training.agent in agents:
        raise InputError(f"agent {spec.training.agent!r} of {spec.name!r} is registered already")
    _SPECS[spec.name] = spec
    return spec


def method_specs() -> list[MethodSpec]:
    """Return all methods, in the order of tables."""
    import_modules("twin.estimation", nested=True)
    places = {name: place for place, name in enumerate(METHODS)}
    return sorted(_SPECS.values(), key=lambda spec: places.get(spec.name, len(places)))


def method_spec(name: str) -> MethodSpec | None:
    """Return the method of a name; None for an unknown one, as in a file of another version."""
    import_modules("twin.estimation", nested=True)
    return _SPECS.get(name)


def find_method(name: str) -> MethodSpec:
    """Return the method of a name; raises `ValueError` for an unknown one."""
    spec = method_spec(name)
    if spec is None:
        names = [spec.name for spec in method_specs()]
        raise InputError(f"unknown method {name!r}{suggestion(name, names)}")
    return spec


def source_of(name: str) -> str:
    """Return the agent whose trained file a method runs on, else its name: parts of one are no rivals."""
    spec = method_spec(name)
    return (spec.agent if spec else None) or name


def trainings() -> dict[str, Training]:
    """Return the trainings of the learned methods, by agent."""
    return {spec.training.agent: spec.training for spec in method_specs() if spec.training}


def find_training(agent: str) -> Training:
    """Return the training of an agent; raises `ValueError` for an unknown one."""
    known = trainings()
    if agent not in known:
        raise InputError(f"unknown agent {agent!r}; valid: {', '.join(known)}")
    return known[agent]


def needed_fits(specs: Iterable[MethodSpec]) -> "list[TrainingFit]":
    """Return the fits that methods need, each once."""
    return list({fit.key: fit for spec in specs for fit in spec.fits}.values())


def proposed_method() -> MethodSpec:
    """Return the method that the paper proposes."""
    return next(spec for spec in method_specs() if spec.presentation.proposed)


@functools.cache
def import_modules(package: str, *, nested: bool = False) -> None:
    """Import the modules of a package, once, so that what they declare is registered.

    Packages within it are left out, unless `nested`.
    """
    path, prefix = importlib.import_module(package).__path__, f"{package}."
    for module in pkgutil.walk_packages(path, prefix) if nested else pkgutil.iter_modules(path, prefix):
        if nested or not module.ispkg:
            importlib.import_module(module.name)


def load_method_files(paths: Iterable[Path]) -> list[MethodSpec]:
    """Run Python files of the user and return the methods that they have registered.

    A method file is a program, not data: naming it on a command line runs it, as `python my_filter.py` would,
    once in a process. Worker processes run it too, as they need its classes. Raises `ValueError` where a file
    does not exist, fails, or registers nothing.
    """
    return [spec for path in paths for spec in _load(path)]


def _load(path: Path) -> list[MethodSpec]:
    known = {spec.name for spec in method_specs()}  # those of the package first: their names are taken
    name = run_program(path, "method file").__name__
    if name not in _LOADED:
        _LOADED[name] = [spec.name for spec in method_specs() if spec.name not in known]
    if not _LOADED[name]:
        raise InputError(f"method file {path} registers no method: end it with register_method(...)")
    return [find_method(method) for method in _LOADED[name]]
