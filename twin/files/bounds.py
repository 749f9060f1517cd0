"""Bounds of numbers and names that a user gives: stated once, checked before any work."""

from twin.errors import InputError
from twin.files.shown import shown

LONGEST_SECONDS = 100_000.0  # of a record that is simulated, more than a day
MOST_SEEDS = 10_000  # draws of a noise
MOST_WORKERS = 1024  # processes, more than any machine has cores
SAMPLE_TIMES = (1e-6, 1000.0)  # shortest and longest time between two samples [s]
MOST_TRAININGS = 100  # of one method that are compared as one row
LARGEST_ERROR_DEG = 10_000.0  # of an initial estimate
LARGEST_VARIANCE_DEG2 = 1e9  # of a measurement
LONGEST_NAME = 120  # characters: longer ones do not fit into the names of files
_MOST_BYTES = 200  # of a file's name in UTF-8, without its ending: file systems take 255 with endings
_HUGE = "a number of more than 30 digits"  # Python refuses to write one of thousands
# More than a letter to a page or a shell. Colons are free: loggers put times into names.
_RESERVED = '<>"|?*'


def check_between(name: str, value: float, least: float, most: float, unit: str = "") -> None:
    """Refuse a number out of its bounds, and one that is not finite."""
    if not least <= value <= most:
        given = f"{value:g}" if isinstance(value, float) else str(value) if abs(value) < 10**30 else _HUGE
        limits = " to ".join(str(end) if isinstance(end, int) else f"{end:g}" for end in (least, most))
        raise InputError(f"{name} = {given}: must be from {limits}{unit and ' '}{unit}")


def wrong_name(name: object) -> str:
    """Return the rule that a name of a preset or record breaks, in words; empty if it breaks none."""
    if not isinstance(name, str):
        return "must be text"
    if len(name) > LONGEST_NAME:
        return f"must have at most {LONGEST_NAME} characters"
    if not name.isprintable():
        return "must be one line of printable characters"
    return ""


def check_name(what: str, name: object) -> None:
    """Refuse a name that is no text, is too long, or has a control character."""
    if rule := wrong_name(name):
        raise InputError(f"{what} = {shown(name)}: {rule}")


def check_file_name(name: str, parameter: str = "name") -> None:
    """Refuse a name that is not the plain name of a file, without folder and ending."""
    rule = wrong_name(name)
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        rule = "must be the name of a file, without folder and ending"
    elif name != name.strip():
        rule = "must be without blanks around"
    elif any(character in _RESERVED for character in name):
        rule = f"must be without any of {' '.join(_RESERVED)}"
    elif not rule and len(name.encode()) > _MOST_BYTES:
        rule = f"must have at most {_MOST_BYTES} bytes"
    if rule:
        raise InputError(f"{parameter} = {shown(name)}: {rule}")
