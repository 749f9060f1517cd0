"""Findings of an evaluation in words: where a method wins and where it does not."""

import dataclasses
from collections.abc import Sequence

from twin.estimation.registry import find_method, find_training, method_specs, proposed_method
from twin.evaluation.paper import noise_label
from twin.evaluation.score import Score
from twin.report.tables import protocol_scores

ON_TWINS = (
    "It has learned on simulated twins, drawn from the ranges of the preset, under noise of every family; "
    "the others on the training records, under one noise."
)
_NBSP = "\N{NO-BREAK SPACE}"


@dataclasses.dataclass(frozen=True)
class Findings:
    """A headline and one line per noise.

    Attributes:
        name: of the method that they are about.
        headline: wins of the method, counted.
        lines: best other method under each noise, and how far it is off.
        note: what the method knows and its rivals do not; empty where that is nothing.
    """

    name: str
    headline: str
    lines: list[str]
    note: str = ""


def all_findings(scores: Sequence[Score]) -> list[Findings]:
    """Return the findings of this project's own method, where it was compared, and of the paper's."""
    compared = {score.method for score in scores}
    leading = [spec.name for spec in method_specs() if spec.presentation.leading and spec.name in compared]
    return [findings(scores, name) for name in (*leading, proposed_method().name)]


def findings(scores: Sequence[Score], name: str) -> Findings:
    """Compare the RMSE of a method with that of every other method that could be deployed.

    Args:
        scores: of an evaluation; oracles, and sample times other than the longest, are left out.
        name: of the method; rows that run on a part of its own trained file are no rivals.

    Returns:
        Findings that count wins by the mean over noise seeds, and say where the 95 % intervals overlap.
    """
    agent, others = find_method(name).agent, [spec for spec in method_specs() if spec.name != name]
    note = ON_TWINS if agent and find_training(agent).on_twins else ""
    parts = {spec.name for spec in others if agent and spec.agent == agent}
    of_paper = [spec.name for spec in others if spec.presentation.paper_column is not None]
    usable = [score for score in protocol_scores(scores) if not score.oracle and score.method not in parts]
    lines, beats_paper, beats_all, clearly, contested = [], 0, 0, 0, 0
    for noise in dict.fromkeys(score.condition for score in usable):
        group = {score.method: score for score in usable if score.condition == noise}
        rivals = {method: score for method, score in group.items() if method != name}
        if name not in group or not rivals:
            continue
        contested += 1
        ours = group[name]
        rival = min(rivals.values(), key=lambda score: score.rmse_deg)
        wins = ours.rmse_deg < rival.rmse_deg
        beats_all += wins
        clearly += wins and not _overlap(ours, rival)
        beats_paper += all(
            ours.rmse_deg < score.rmse_deg for method, score in rivals.items() if method in of_paper
        )
        lines.append(_line(ours, rival))
    if not contested:
        return Findings(name, f"These results do not compare {name} with another method.", lines, note)
    compared = f"the paper's comparisons ({', '.join(of_paper)})"
    verdict = "every method tried" if beats_all == beats_paper else compared
    headline = f"{name} has a lower RMSE than {verdict} under {beats_paper} of {_noises(contested)}"
    if beats_all != beats_paper:
        headline += f", and than every method tried under {beats_all}"
    if beats_all > clearly:
        headline += f" ({clearly} of these beyond the 95{_NBSP}% intervals)"
    return Findings(name, f"{headline}.", lines, note)


def _line(ours: Score, rival: Score) -> str:
    change = 100 * (ours.rmse_deg / rival.rmse_deg - 1)
    line = (
        f"{noise_label(*ours.condition)}: {ours.method} {ours.rmse_deg:.3f} deg, best other method "
        f"{rival.method} {rival.rmse_deg:.3f} deg ({ours.method} {change:+.0f}{_NBSP}%)"
    )
    if _overlap(ours, rival):
        line += f"; their 95{_NBSP}% intervals overlap"
    published = ours.paper_rmse_deg
    if published is None:
        return f"{line}."
    return f"{line}. The paper's {ours.method}: {published + 1e-9:.3f} deg."


def _overlap(first: Score, second: Score) -> bool:
    """True where the intervals of two scores share a value."""
    (low, high), (other_low, other_high) = first.rmse_ci95_deg, second.rmse_ci95_deg
    return low <= other_high and other_low <= high


def _noises(count: int) -> str:
    return f"{count} noises" if count > 1 else "1 noise"
