"""Rules that `endotwin generate --verify` holds a dataset to, by name."""

from collections.abc import Iterable

RULES = {
    "files": "every file that dataset.json lists is there, and no other MCAP file",
    "bytes": "every file has the size and the SHA-256 that dataset.json states",
    "readable": "every file is a whole MCAP file: each CRC, count and message",
    "length": "every file has the samples and seconds that dataset.json states",
    "quantities": "every file holds the quantities that dataset.json describes, with unit and shape",
    "statistics": "the statistics of every quantity, computed anew, are those of dataset.json",
    "origin": "every file says of itself what dataset.json says of it: seed, signal, versions",
    "recipe": "the recipe of the folder is that of dataset.json, and every file was made from it",
    "totals": "counts and statistics of the whole dataset follow from those of its files",
    "tables": "every CSV table has the SHA-256 that dataset.json states",
    "card": "the card and its figure are there",
}
"""Rules, by name, and the demand of each. Not every kind of dataset has a recipe, tables or a card."""


class RuleFault(str):
    """A fault of a dataset, in one line, that knows which rule it breaks.

    Attributes:
        rule: its name, of `RULES`.
    """

    rule: str

    def __new__(cls, rule: str, text: str) -> "RuleFault":
        """Return the fault of a rule."""
        fault = super().__new__(cls, text)
        fault.rule = rule
        return fault


def faults_of(rule: str, lines: Iterable[str]) -> list[RuleFault]:
    """Return lines as faults of a rule."""
    return [RuleFault(rule, line) for line in lines]
