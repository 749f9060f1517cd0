"""Headline of an evaluation: in one sentence, which method errs least, and against what."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from twin.estimation.registry import MethodSpec, method_spec, proposed_method
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import Score
from twin.report.tables import protocol_scores


@dataclasses.dataclass(frozen=True)
class Ranked:
    """Error of a method over all noises.

    Attributes:
        name: of the method, an oracle labelled.
        rmse_deg: geometric mean of its RMSE over the noises [deg].
        oracle: whether it is shown the truth.
        spec: its declaration; None for one of another version.
    """

    name: str
    rmse_deg: float
    oracle: bool
    spec: MethodSpec | None

    @property
    def is_part(self) -> bool:
        """True for a part of another method's trained file: it shows what the whole is worth."""
        return self.spec is not None and self.spec.trained_as is not None

    @property
    def is_limit(self) -> bool:
        """True for what others are measured against: it knows what no device tells."""
        return self.spec is not None and self.spec.presentation.is_limit


def ranked(scores: Sequence[Score]) -> list[Ranked]:
    """Return methods that were scored under every noise of the first records, the best first."""
    scores = protocol_scores(scores) if scores else []
    noises = {score.condition for score in scores}
    found = []
    for label in dict.fromkeys(score.label for score in scores):
        own = {score.condition: score for score in scores if score.label == label}
        if own.keys() == noises:
            mean = float(geometric_mean(np.array([score.rmse_deg for score in own.values()])))
            one = next(iter(own.values()))
            found.append(Ranked(label, mean, one.oracle, method_spec(one.method)))
    return sorted(found, key=lambda method: method.rmse_deg)


def evaluation_headline(scores: Sequence[Score]) -> str:
    """Return what a reader should take away, in one sentence; an oracle and the limit are named as such.

    Args:
        scores: of an evaluation; those of the first records at the longest sample time count.
    """
    methods = ranked(scores)
    usable = [method for method in methods if not (method.oracle or method.is_limit or method.is_part)]
    if not usable:
        return "These results hold no method that could be deployed."
    noises = len({score.condition for score in protocol_scores(scores)})
    best, *others = usable
    over = f"over {noises} noises" if noises > 1 else "under one noise"
    said = f"{best.name} estimates the bending angle to {best.rmse_deg:.2f} deg (RMSE {over})"
    if others:
        said += f", {_less(best, others[0])} less error than {others[0].name}"
        said += ", the next of what could be deployed" if len(others) > 1 else ""
        paper = next((method for method in others[1:] if method.name == proposed_method().name), None)
        if paper:
            said += f", and {_less(best, paper)} less than {paper.name} as the paper has it"
    beyond = [method for method in methods if method.oracle or method.is_limit]
    if beyond:
        told = (
            "the limit, which knows the noise's density" if beyond[0].is_limit else "which is shown the truth"
        )
        said += f"; {beyond[0].name}, {told}, is at {beyond[0].rmse_deg:.2f} deg"
    return f"{said}."


def _less(best: Ranked, other: Ranked) -> str:
    return f"{1 - best.rmse_deg / max(other.rmse_deg, 1e-9):.0%}".replace("%", " %")
