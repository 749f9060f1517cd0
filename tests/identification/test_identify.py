"""Records and options that identify nothing are refused."""

import numpy as np
import pytest
from identifying import TIME, records_of
from models import PAPER

from twin.hysteresis import MODELS
from twin.identification import NEVER_REVERSES, identify


@pytest.mark.parametrize("name", MODELS)
def test_records_that_cannot_identify_a_loop_are_refused(name):
    moving, bend = records_of(PAPER)[0]
    rising = np.linspace(2, 4, 50)
    with_gap = bend.copy()
    with_gap[7] = np.nan
    for records, rule in (
        ([], "no record"),
        ([(rising, 20 * rising)], "never reverses"),
        ([(rising, 20 * rising), (rising[::-1], 20 * rising)], "never reverses"),
        ([(np.full(50, 3.0), np.full(50, 60.0))], "record 0: the command never moves"),
        ([(moving, bend), (moving, with_gap)], "record 1: command and angle must be finite"),
        ([(np.where(TIME > 3, np.inf, moving), bend)], "record 0: command and angle must be finite"),
    ):
        with pytest.raises(ValueError, match=rule):
            identify(records, 0, name)
    assert "reversal" in NEVER_REVERSES


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (
            {"name": "preisach"},
            "unknown model 'preisach'; valid: coleman-hodgdon, bouc-wen, prandtl-ishlinskii",
        ),
        ({"name": "bouc-wen", "monotone": True}, "coleman-hodgdon models only, not bouc-wen"),
        ({"name": "prandtl-ishlinskii", "monotone": True}, "coleman-hodgdon models only"),
        ({"name": "bouc-wen", "thresholds_mm": (0.0, 1.0)}, "prandtl-ishlinskii models only"),
        ({"name": "prandtl-ishlinskii", "thresholds_mm": (0.0, -1.0)}, "not negative"),
        ({"name": "prandtl-ishlinskii", "thresholds_mm": (0.5, 0.5)}, "must be different"),
        ({"population": 3}, "population = 3"),
        ({"name": "bouc-wen", "generations": 0}, "generations = 0"),
    ],
)
def test_option_that_a_model_does_not_have_is_refused(options, rule):
    with pytest.raises(ValueError, match=rule):
        identify(records_of(PAPER), 0, **options)
