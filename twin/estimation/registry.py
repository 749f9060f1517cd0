"""The method table: every estimator, declared once, in the file where it lives.

Tables, figures, suites, `endotwin train` and `endotwin evaluate` read it. A new estimator is one new file in
this package, or below it, that calls `register_method`. This module is light: it loads nothing but Python.
"""

import dataclasses
import importlib
import pkgutil
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Literal

from twin.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from twin.estimation.case import CaseEstimator
    from twin.estimation.estimator import Estimator
    from twin.estimation.knowledge import Knowledge, TrainingFit

Family = Literal["model", "filter", "set-membership filter", "tuned filter", "learned", "ensemble"]


@dataclasses.dataclass(frozen=True)
class Style:
    """Colour, line and marker of a method in figures.

    Attributes:
        colour: as `#rrggbb`.
        line: a line style of matplotlib.
        marker: a marker of matplotlib; none where it is empty.
        width: of the line [points].
    """

    colour: str
    line: Any
    marker: str
    width: float = 1.1


@dataclasses.dataclass(frozen=True)
class Training:
    """Training of a learned method, as the command line and a run folder name it.

    Attributes:
        agent: word of `endotwin train --agent`.
        file: name of the trained file in a run folder.
        load: reads such a file.
        purpose: a few words for the help of the command line.
        same_filter: whether it runs beside the very filter that it was trained beside, and no other.
        on_twins: whether it is trained on simulated twins of a preset, without records, for any sample time.
    """

    agent: str
    file: str
    load: "Callable[[Path], Estimator[Any]]"
    purpose: str
    same_filter: bool = False
    on_twins: bool = False


@dataclasses.dataclass(frozen=True)
class MethodSpec:
    """Declaration of one method: all that tables, figures and commands need to know of it.

    Attributes:
        name: in tables, figures and files.
        rank: place in tables, the smallest first.
        family: kind of method.
        told: what it is told of the noise, in a few words.
        build: makes the estimator, or a function of a whole `Case`, from what may be known before the test.
        models: names of the identified models of hysteresis that it needs.
        fits: numbers that are found on the training records, which it needs.
        records: whether it needs the training records themselves.
        wire_offset: whether it needs the smallest wire offset that a twin may have.
        ensembles: whether it needs ensembles of twins along the test's commands.
        needs_density: whether it needs the density of the noise, which a recorded noise and a faulty sensor
            do not have.
        training: how it is trained; None for what is not learned.
        trained_as: agent whose trained file it runs on; that of `training`, if not given.
        in_paper_suite: whether the suite `paper` has it.
        on_request: whether the suite `full` has it only where it is named or its trained file is given; it
            has every other method.
        proposed: whether it is the method that the paper proposes.
        leading: whether it is this project's own: a report is about it where it was compared.
        oracle: whether it is shown the truth: such a row is labelled, and no deployable result.
        is_limit: whether other methods are measured against it.
        paper_column: its column in the paper's Tables II and III, from the left, if it has one.
        paper_figures: figures of the paper that show it.
        beside_paper: whether the full suite shows it in the paper's tables too.
        style: in figures; a grey one by its place where it has none of its own.
    """

    name: str
    rank: float
    family: Family
    told: str
    build: "Callable[[Knowledge], Estimator[Any] | CaseEstimator]"
    models: tuple[str, ...] = ()
    fits: "tuple[TrainingFit, ...]" = ()
    records: bool = False
    wire_offset: bool = False
    ensembles: bool = False
    needs_density: bool = False
    training: Training | None = None
    trained_as: str | None = None
    in_paper_suite: bool = False
    on_request: bool = False
    proposed: bool = False
    leading: bool = False
    oracle: bool = False
    is_limit: bool = False
    paper_column: int | None = None
    paper_figures: tuple[int, ...] = ()
    beside_paper: bool = False
    style: Style | None = None

    @property
    def agent(self) -> str | None:
        """Agent whose trained file it runs on; None for what is not learned."""
        return self.training.agent if self.training else self.trained_as

    def missing(self, knowledge: "Knowledge") -> list[str]:
        """Return what it needs and nobody knows, in words; its fits are found from the records."""
        missing = [f"the model {model}" for model in self.models if model not in knowledge.models]
        if (self.records or self.fits) and not knowledge.records:
            missing.append("training records")
        if self.wire_offset and knowledge.smallest_wire_offset is None:
            missing.append("the ranges of a preset")
        if self.ensembles and not knowledge.ensembles:
            missing.append("ensembles of twins")
        if self.agent is not None and self.agent not in knowledge.trained:
            source = "" if find_training(self.agent).on_twins else ", or training records"
            missing.append(f"a trained file of {self.agent}{source}")
        return missing

    def is_ready(self, knowledge: "Knowledge") -> bool:
        """Return whether all that it needs is known."""
        return not self.missing(knowledge)


_SPECS: dict[str, MethodSpec] = {}
_SEARCHED: list[str] = []


def register_method(spec: MethodSpec) -> MethodSpec:
    """Add a method to the table and return it.

    Raises:
        ValueError: another method has this name, or another one is trained under this agent.
    """
    if spec.name in _SPECS:
        raise InputError(f"method {spec.name!r} is registered already")
    taken = {known.training.agent for known in _SPECS.values() if known.training}
    if spec.training and spec.training.agent in taken:
        raise InputError(f"agent {spec.training.agent!r} of {spec.name!r} is registered already")
    _SPECS[spec.name] = spec
    return spec


def method_specs() -> list[MethodSpec]:
    """Return all methods, in the order of tables."""
    _search()
    return sorted(_SPECS.values(), key=lambda spec: spec.rank)


def method_spec(name: str) -> MethodSpec | None:
    """Return the method of a name; None for one that is not in the table, as in a file of another version."""
    _search()
    return _SPECS.get(name)


def find_method(name: str) -> MethodSpec:
    """Return the method of a name.

    Raises:
        ValueError: there is none.
    """
    spec = method_spec(name)
    if spec is None:
        raise InputError(f"unknown method {name!r}; valid: {', '.join(s.name for s in method_specs())}")
    return spec


def trainings() -> dict[str, Training]:
    """Return the trainings of the learned methods, by agent."""
    return {spec.training.agent: spec.training for spec in method_specs() if spec.training}


def find_training(agent: str) -> Training:
    """Return the training of the method that is trained under an agent.

    Raises:
        ValueError: there is none.
    """
    known = trainings()
    if agent not in known:
        raise InputError(f"unknown agent {agent!r}; valid: {', '.join(known)}")
    return known[agent]


def needed_fits(specs: Iterable[MethodSpec]) -> "list[TrainingFit]":
    """Return the fits that methods need, each once."""
    return list({fit.key: fit for spec in specs for fit in spec.fits}.values())


def proposed_method() -> MethodSpec:
    """Return the method that the paper proposes."""
    return next(spec for spec in method_specs() if spec.proposed)


def _search() -> None:
    """Import every module of `twin.estimation`, each of which registers its methods."""
    if _SEARCHED:
        return
    package = importlib.import_module("twin.estimation")
    for module in pkgutil.walk_packages(package.__path__, "twin.estimation."):
        importlib.import_module(module.name)
    _SEARCHED.append("twin.estimation")
