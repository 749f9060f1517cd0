"""Files of a comparison for papers: figures in two widths, tables in LaTeX, sources of methods in BibTeX."""

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from twin import __version__
from twin.episode import Record
from twin.evaluation.paper import TABLES, noise_label
from twin.evaluation.protocol import Condition
from twin.evaluation.ranking import Ranking
from twin.evaluation.score import Score
from twin.files.assets import assets_folder
from twin.files.atomic import MADE_BY, write_whole
from twin.report import tables
from twin.report.figures import PAPER_FIGURES, comparison_figures, to_bytes

FIGURES = ("rmse", "times_the_limit", "ranks", "intervals", *(f"figure_{of:02d}" for of in PAPER_FIGURES))
NAMES = (
    *(f"{name}{end}.{kind}" for name in FIGURES for end in ("", "_column") for kind in ("png", "pdf", "svg")),
    "tables.tex",
    "methods.bib",
)
"""Names of all of these files."""
MANY = 6  # kinds of noise side by side for which a table needs smaller letters
_INDICES = {"mae_deg": "MAE", "rmse_deg": "RMSE", "md_deg": "MD", "var_deg2": "Var"}
_TEX = {of: f"\\{of}" for of in "&%$#_{}"} | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}"}
_TEX |= {
    "[": "{[}",
    "^": r"\textasciicircum{}",
    "<": "$<$",
    ">": "$>$",
    "²": r"\textsuperscript{2}",
    "λ": r"$\lambda$",
}


def write_publication(
    out: Path,
    scores: Sequence[Score],
    tracks: Mapping[Condition, Record],
    rankings: Sequence[Ranking],
    formats: Sequence[str],
) -> None:
    """Write the figures in every format, `tables.tex` and `methods.bib` into the folder of the results."""
    for name, figure in comparison_figures(scores, tracks, rankings).items():
        for kind in formats:
            write_whole(out / f"{name}.{kind}", to_bytes(figure, kind))
    write_whole(out / "tables.tex", latex_tables(scores))
    write_whole(out / "methods.bib", bibliography(score.method for score in scores))


def bibliography(methods: Iterable[str]) -> str:
    """Return the sources of methods, and this software, as BibTeX."""
    entries, wanted = re.split(r"\n(?=@)", (assets_folder() / "methods.bib").read_text()), set(methods)
    shown = [entry.strip() for entry in entries[1:] if not (of := methods_of(entry)) or of & wanted]
    return "\n\n".join([MADE_BY, *shown]).replace("VERSION", __version__) + "\n"


def methods_of(entry: str) -> set[str]:
    """Return the names of the methods that rest on a source; none for this software."""
    found = re.search(r"keywords = \{(.*?)\}", entry)
    return set(found[1].split("; ")) if found else set()


class _Column(NamedTuple):
    noise: Condition
    field: str  # of `Score`
    above: str  # lines of the heading
    below: str


def latex_tables(scores: Sequence[Score]) -> str:
    """Return the RMSE under every noise, and the paper's tables, in LaTeX for the package booktabs.

    Oracles and yardsticks stand below a line.
    """
    first = tables.protocol_scores(scores)
    noises = list(dict.fromkeys(score.condition for score in first))
    setting = tables.setting(first[0].group, first[0].sample_time_s, first[0].seeds)
    caption = f"RMSE [deg] on {setting}; R in deg². {tables.BOLD}"
    if any(score.paper_rmse_deg is not None for score in first):
        caption += " In brackets: the RAM paper, on another endoscope."
    named = [(noise, noise_label(*noise).partition(", ")) for noise in noises]
    columns = [
        _Column(noise, "rmse_deg", kind, level.replace(" deg²", "")) for noise, (kind, _, level) in named
    ]
    parts = [f"% {MADE_BY}; needs \\usepackage{{booktabs}}", _table("rmse", caption, first, columns)]
    for table in TABLES:
        columns = [
            _Column((table.noise, level), index, f"{table.symbol} = {level:g}", title)
            for level in table.values
            for index, title in _INDICES.items()
            if (table.noise, level) in noises
        ]
        if columns:
            caption = f"{table.noise.capitalize()} noise on {setting}: errors [deg], and Var [deg²]."
            parts.append(_table(table.noise, f"{caption} {tables.BOLD}", first, columns))
    return "\n\n".join(parts) + "\n"


def _table(label: str, caption: str, scores: Sequence[Score], columns: Sequence[_Column]) -> str:
    """Return a table of methods by columns; `scores` are those of one group of episodes."""
    cells = {(score.label, score.condition): score for score in scores}
    lines: dict[bool, list[str]] = {True: [], False: []}
    for name in tables.ordered(score.label for score in scores):
        row = [_tex(name), *(_cell(cells.get((name, of.noise)), of.field, label == "rmse") for of in columns)]
        deployable = any(tables.is_deployable(score) for score in scores if score.label == name)
        lines[deployable].append(" & ".join(row) + r" \\")
    above, rules, place = [], [], 2
    for head, run in itertools.groupby(of.above for of in columns):
        width = len(list(run))
        above.append(rf"\multicolumn{{{width}}}{{c}}{{{_tex(head)}}}")
        rules.append(rf"\cmidrule(lr){{{place}-{place + width - 1}}}")
        place += width
    letters = "footnotesize" if len(above) < MANY else "scriptsize"
    body = [*lines[True], *([r"\midrule"] if all(lines.values()) else []), *lines[False]]
    return "\n".join(
        [
            r"\begin{table*}",
            rf"\centering\{letters}\setlength{{\tabcolsep}}{{3pt}}",
            rf"\caption{{{_tex(caption)}}}\label{{tab:endotwin-{label}}}\smallskip",
            rf"\begin{{tabular}}{{l{'r' * len(columns)}}}",
            r"\toprule",
            rf" & {' & '.join(above)} \\ {''.join(rules)}",
            rf"method & {' & '.join(_tex(of.below) for of in columns)} \\ \midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table*}",
        ]
    )


def _cell(score: Score | None, field: str, brackets: bool) -> str:
    if score is None:
        return "--"
    value = f"{getattr(score, field):.{2 if brackets else 3}f}"
    shown = rf"\textbf{{{value}}}" if score.is_best and field == "rmse_deg" else value
    published = score.paper_rmse_deg if brackets else None
    return shown if published is None else f"{shown} ({tables.paper_figure(published, 2)})"


def _tex(text: str) -> str:
    return "".join(_TEX.get(letter, letter) for letter in text)
