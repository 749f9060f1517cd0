"""Models of hysteresis that tests filter with, identify and compare."""

import pytest

from twin.hysteresis import MODELS, BoucWen, ColemanHodgdon

PAPER = (1.15, 22.38, 5.0)
"""a, b and c that the paper identified, eq. 12."""
COLEMAN_HODGDON = ColemanHodgdon(*PAPER)
BOUC_WEN = BoucWen(22.0, -15.0, 1.2, 1.5, 2.0)
NAMES = [*sorted(MODELS.keys() - {"bouc-wen"}), pytest.param("bouc-wen", marks=pytest.mark.slow)]
"""Models that are identified: Bouc-Wen takes the longest."""
