"""Numbers of the fields of a table: decimal digits with a point, and nothing else that Python would take.

Where commas do not separate fields, one may stand in the place of the point.

`float` also reads `1_000`, digits of other scripts, `infinity` and blanks of other scripts; a log that holds
them was not written by a logger, or means something else.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none"})
"""Texts that mean a missing value, in lower case."""

_PLAIN = b"0123456789.+-eE \t"
"""Characters of a number; blanks may stand around it."""


def to_numbers(texts: Sequence[str], *, comma: bool = False) -> Array:
    """Return the numbers of texts, (N,): NaN where a text is no finite number.

    Args:
        texts: of the fields.
        comma: a decimal comma may stand in the place of the point; a text with both is no number.
    """
    if comma:
        texts = [text.replace(",", ".") for text in texts]  # two points are no number
    if not "".join(texts).encode().translate(None, _PLAIN):
        try:
            values = np.fromiter(map(float, texts), float, len(texts))
        except ValueError:
            pass
        else:
            values[np.isinf(values)] = np.nan
            return values
    return np.fromiter(map(to_number, texts), float, len(texts))


def to_number(text: str) -> float:
    """Return the number that a text is; NaN if it is no finite number."""
    if text.encode().translate(None, _PLAIN):
        return np.nan
    try:
        value = float(text)
    except ValueError:
        return np.nan
    return value if np.isfinite(value) else np.nan


def is_missing(text: str) -> bool:
    """Return True if a text means a missing value."""
    return text.strip().lower() in MISSING
