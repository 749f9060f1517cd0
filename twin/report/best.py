"""The best of a line of a table: who is named so must be better than all others beyond doubt."""

from collections.abc import Iterable

from twin.evaluation.ranking import competes
from twin.evaluation.score import Score


def clear_best(scores: Iterable[Score]) -> str | None:
    """Return the method of the least RMSE, where the paired 95 % intervals of all others exclude it.

    Args:
        scores: of one noise on one group of records. Oracles and ensembles do not compete.

    Returns:
        Its label; None where another is level with it, or nobody can say.
    """
    racing = sorted(
        (score for score in scores if competes(score.method, score.oracle)), key=lambda score: score.rmse_deg
    )
    if not racing or any(score.to_best_ci95 is None or score.to_best_ci95[0] <= 1 for score in racing[1:]):
        return None
    return racing[0].label
