"""Numbers as they are written in pictures: with a true minus sign, and no sign before a zero."""

MINUS = "\N{MINUS SIGN}"


def signed(value: float, digits: int = 1) -> str:
    """Return a number with its sign; one that rounds to zero has none."""
    text = f"{value:+z.{digits}f}"
    if float(text) == 0:
        return text[1:]
    return text.replace("-", MINUS)


def angle(value_deg: float, digits: int = 1) -> str:
    """Return an angle with its sign, as in `+12.3°`."""
    return f"{signed(value_deg, digits)}°"


def times_real(speed: float) -> str:
    """Return how fast a film goes, as in `4x`; `real time` where it is as fast as what it shows."""
    return "real time" if speed == 1 else f"{speed:.3g}\N{MULTIPLICATION SIGN}"
