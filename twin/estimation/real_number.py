"""Real numbers of any type, as a live stream and its settings may have them."""

import math
import numbers
import reprlib
from typing import Any

import numpy as np

from twin.errors import InputError


def real_number(name: str, value: Any) -> float:
    """Return a real number of any type as a float.

    Raises:
        ValueError: it is none.
    """
    whole_array = type(value) is np.ndarray and value.ndim == 0 and value.dtype.kind in "fiu"
    if not (isinstance(value, numbers.Real) or whole_array):
        shown = " ".join(reprlib.repr(value).split())[:40]
        raise InputError(f"{name} = {shown}: must be a number, not {type(value).__name__[:40]}")
    try:
        return float(value)
    except OverflowError:  # a whole number beyond all floats
        return math.inf if value > 0 else -math.inf
