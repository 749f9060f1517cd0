"""Every measured number of the documents comes from a file of docs/data, and is as that file has it."""

import re

import pytest
from repository import REPOSITORY

from scripts.studies.tables import FIGURE, TABLE

HELD = (
    "README.md",
    "docs/results/paper_protocol.md",
    "docs/results/benchmark.md",
    "docs/benchmark/index.md",
)
"""Documents whose measured numbers all come from files."""
NOT_PROSE = (
    TABLE,
    FIGURE,
    re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE),
    re.compile(r"`[^`]*`"),
    re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.DOTALL),
    re.compile(r"\]\([^)]*\)"),
    re.compile(r"^#+ .*$", re.MULTILINE),
)
"""What has no figures, or figures from files."""
_NUMBER = r"[-+±]*\d[\d.,]*"
SETTINGS = tuple(
    re.compile(pattern)
    for pattern in (
        rf"(?:{_NUMBER}(?:\s+(?:to|and|or)\s+|[;/]?\s+)?)+[^\s\d<]*(?: [^\s\d<]+)?<!-- setting -->",
        rf"[\w²]+ ?(?:=|<=|>=|<|>|≤) ?{_NUMBER}(?: %)?",  # T = 0.1 s, R = 0.1
        rf"\[{_NUMBER}, {_NUMBER}\]",  # a stroke
        rf"(?:Poisson|Gaussian|lambda|[Ll]ognormal|Weibull|gamma|dithered)(?: noise)?(?: of)?,? {_NUMBER}",
        r"\b9[05] % (?:confidence )?(?:interval|within)s?",
        r"(?:Python |Newton |version |Apache-|\bv)\d+\.[\d.]*\d",
    )
)
"""Numbers that someone chose: parameters, strokes, noise, versions, and those before `<!-- setting -->`."""
MEASURED = re.compile(r"\d+\.\d+|\d\s?%|\d\s+times\b")


def bare_numbers(text: str) -> list[str]:
    """Measured numbers of a document that have no file behind them, each with the words around it."""
    for pattern in (*NOT_PROSE, *SETTINGS):
        text = pattern.sub(" _ ", text)
    return [text[max(found.start() - 40, 0) : found.end() + 20] for found in MEASURED.finditer(text)]


@pytest.mark.parametrize("name", HELD)
def test_every_measured_number_has_a_file_behind_it(name):
    assert not bare_numbers((REPOSITORY / name).read_text())
