"""A page for each condition of a comparison: every method under one noise, on every kind of record."""

from collections.abc import Sequence

from twin.estimation.registry import method_spec
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import RECORDED, SUITES, Condition
from twin.evaluation.score import Score
from twin.files.atomic import MADE_BY
from twin.report.best import clear_best
from twin.report.limit import chosen_scores, groups_of
from twin.report.tables import aligned_table, group_name
from twin.signals.noise import noise_variance


def page_name(condition: Condition) -> str:
    """Return the name of the page of a condition."""
    kind, level = condition
    return f"condition_{kind}.md" if kind == RECORDED else f"condition_{kind}_{level:g}.md"


def page_names() -> list[str]:
    """Return the names of the pages of every suite."""
    conditions = [condition for suite in SUITES.values() for condition in suite]
    return list(dict.fromkeys(map(page_name, [*conditions, (RECORDED, 0.0)])))


def condition_pages(scores: Sequence[Score]) -> dict[str, str]:
    """Return a page in Markdown for each condition, by its name.

    Args:
        scores: of all sample times and groups of records.
    """
    conditions = list(dict.fromkeys(score.condition for score in scores))
    return {page_name(condition): _page(scores, condition) for condition in conditions}


def _page(scores: Sequence[Score], condition: Condition) -> str:
    kind, level = condition
    parts = [f"# {noise_label(*condition)}"]
    variance = level if kind == RECORDED else noise_variance(kind, level)
    parts.append(
        f"R = {variance:.3g} deg^2 is what filters are told of it. A figure in bold is below that of every "
        "other method that competes, beyond its paired 95 % interval."
    )
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    for group in groups_of(scores):
        for T in times:
            of = [score for score in chosen_scores(scores, T, group) if score.condition == condition]
            if of:
                parts += [f"## {group_name(group)}, T = {T:g} s", _table(of)]
    return "\n\n".join(parts) + f"\n\n<!-- {MADE_BY} -->\n"


def _table(scores: Sequence[Score]) -> str:
    """Return the methods under one condition on one kind of records, the least error on top."""
    best = clear_best(scores)
    lines = []
    for score in sorted(scores, key=lambda of: of.rmse_deg):
        low, high = score.rmse_ci95_deg
        rmse = f"{score.rmse_deg:.3f} ± {(high - low) / 2:.3f}"
        spec = method_spec(score.method)
        to_best = score.to_best_ci95
        lines.append(
            [
                score.label,
                spec.noise_information if spec else "-",
                f"**{rmse}**" if score.label == best else rmse,
                f"{to_best[0]:.2f} to {to_best[1]:.2f}" if to_best else "-",
                f"{score.rmse_steady_deg:.3f}",
                "-" if score.coverage95 is None else f"{100 * score.coverage95:.0f}",
                "-" if score.width95_deg is None else f"{score.width95_deg:.2f}",
            ]
        )
    headers = [
        "method",
        "known of the noise",
        "RMSE [deg]",
        "times the best",
        "after 5 s [deg]",
        "coverage [%]",
        "width [deg]",
    ]
    return aligned_table(lines, headers, left=2)
