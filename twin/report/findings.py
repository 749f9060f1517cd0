"""What the rows of `evaluation.json` say about RAM, in words: where it wins and where it does not."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from twin.evaluation.paper import METHODS, noise_label, paper_value
from twin.report.tables import protocol_rows

_PROPOSED = "RAM"
_NBSP = "\N{NO-BREAK SPACE}"


@dataclasses.dataclass(frozen=True)
class Findings:
    """A headline and one line per noise."""

    headline: str
    lines: list[str]


def findings(rows: Sequence[dict[str, Any]]) -> Findings:
    """Compare the RMSE of RAM with that of every other method that could be deployed.

    Args:
        rows: of `evaluation.json`; oracles, and sample times other than the longest, are left out.

    Returns:
        Findings that count wins by the mean over noise seeds, and say where the 95 % intervals overlap.
    """
    usable = [row for row in protocol_rows(rows) if not row.get("oracle")]
    noises = list(dict.fromkeys((str(row["noise"]), float(row["level"])) for row in usable))
    lines, beats_paper, beats_all, clearly, contested = [], 0, 0, 0, 0
    for noise, level in noises:
        group = {r["method"]: r for r in usable if (r["noise"], float(r["level"])) == (noise, level)}
        others = {method: row for method, row in group.items() if method != _PROPOSED}
        if _PROPOSED not in group or not others:
            continue
        contested += 1
        ram = group[_PROPOSED]
        rival = min(others, key=lambda method: others[method]["rmse_deg"])
        wins = ram["rmse_deg"] < others[rival]["rmse_deg"]
        beats_all += wins
        clearly += wins and not _overlap(ram, others[rival])
        beats_paper += all(
            ram["rmse_deg"] < row["rmse_deg"] for method, row in others.items() if method in METHODS
        )
        lines.append(_line(noise, level, ram, rival, others[rival]))
    if not contested:
        return Findings("These results do not compare RAM with another method.", lines)
    verdict = "every method tried" if beats_all == beats_paper else "the paper's comparisons (C-H, AM, LSTM)"
    headline = f"RAM has a lower RMSE than {verdict} under {beats_paper} of {_noises(contested)}"
    if beats_all != beats_paper:
        headline += f", and than every method tried under {beats_all}"
    if beats_all > clearly:
        headline += f" ({clearly} of these beyond the 95{_NBSP}% intervals)"
    return Findings(f"{headline}.", lines)


def _line(noise: str, level: float, ram: dict[str, Any], rival: str, other: dict[str, Any]) -> str:
    ours, theirs = ram["rmse_deg"], other["rmse_deg"]
    change = 100 * (ours / theirs - 1)
    line = (
        f"{noise_label(noise, level)}: RAM {ours:.3f} deg, best other method {rival} {theirs:.3f} deg "
        f"(RAM {change:+.0f}{_NBSP}%)"
    )
    if _overlap(ram, other):
        line += f"; their 95{_NBSP}% intervals overlap"
    published = paper_value(noise, level, _PROPOSED, "rmse_deg")
    return f"{line}. The paper's RAM: {published + 1e-9:.3f} deg." if published is not None else f"{line}."


def _overlap(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Whether the intervals of two rows share a value; a row without one counts as its RMSE alone."""
    low, high = first.get("rmse_ci95_deg") or [first["rmse_deg"]] * 2
    other_low, other_high = second.get("rmse_ci95_deg") or [second["rmse_deg"]] * 2
    return bool(low <= other_high and other_low <= high)


def _noises(count: int) -> str:
    return f"{count} noises" if count > 1 else "1 noise"
