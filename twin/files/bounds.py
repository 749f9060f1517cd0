"""Bounds of the numbers that a user gives: stated once, checked before anything is allocated or simulated."""

from twin.errors import InputError

LONGEST_SECONDS = 100_000.0
"""Longest record that is simulated, more than a day [s]."""
MOST_SEEDS = 10_000
"""Largest number of draws of a noise."""
MOST_WORKERS = 1024
"""Largest number of processes, more than any machine has cores."""
SAMPLE_TIMES = (1e-6, 1000.0)
"""Shortest and longest time between two samples [s]."""
LARGEST_ERROR_DEG = 10_000.0
"""Largest error of an initial estimate [deg]."""
LARGEST_VARIANCE_DEG2 = 1e9
"""Largest variance of a measurement [deg^2]."""


def check_between(name: str, value: float, least: float, most: float, unit: str = "") -> None:
    """Refuse a number out of its bounds, and one that is not finite.

    Args:
        name: of the parameter, for the message.
        value: what was given.
        least: smallest value that may be.
        most: largest value that may be.
        unit: of the numbers, for the message.

    Raises:
        ValueError: it is out of them.
    """
    if not least <= value <= most:
        given = f"{value:g}" if isinstance(value, float) else _cut(value)
        limits = f"from {_plain(least)} to {_plain(most)}"
        raise InputError(f"{name} = {given}: must be {limits}{unit and ' '}{unit}")


def _plain(limit: float) -> str:
    return f"{limit:d}" if isinstance(limit, int) else f"{limit:g}"


def _cut(value: int) -> str:
    """Return a whole number for a message; Python refuses to spell one of thousands of digits."""
    return str(value) if abs(value) < 10**30 else "a number of more than 30 digits"
