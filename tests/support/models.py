"""Models of hysteresis that tests filter with, identify and compare."""

from twin.hysteresis import BoucWen, ColemanHodgdon

PAPER = (1.15, 22.38, 5.0)
"""a, b and c that the paper identified, eq. 12."""
COLEMAN_HODGDON = ColemanHodgdon(*PAPER)
BOUC_WEN = BoucWen(22.0, -15.0, 1.2, 1.5, 2.0)
