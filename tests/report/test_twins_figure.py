"""Figure of both twins: what is drawn, in which order, and what is refused."""

import numpy as np
import pytest

from twin.preset.file import load_preset
from twin.reduced import simulate
from twin.report.figures import to_png_bytes
from twin.report.twins_figure import twins_figure

PRESET = load_preset("ureteroscope")
PULL = 2e-3 * np.sin(np.arange(40) / 6)
REDUCED = simulate(PRESET, PULL, 0.1)
OTHER = simulate(PRESET.replace(section_stiffness=1.1 * PRESET.section_stiffness), PULL, 0.1)


def test_loops_and_differences_are_those_of_the_records():
    figure = twins_figure(REDUCED, [("step h", OTHER), ("h / 8", REDUCED)])
    loop, away = figure.axes
    np.testing.assert_array_equal(loop.lines[1].get_ydata(), REDUCED.truth_deg)
    np.testing.assert_array_equal(away.lines[0].get_ydata(), REDUCED.truth_deg - OTHER.truth_deg)
    assert not np.any(away.lines[1].get_ydata())
    assert [text.get_text() for text in away.get_legend().get_texts()] == ["step h", "h / 8"]
    assert to_png_bytes(figure, dpi=40).startswith(b"\x89PNG")


def test_records_that_do_not_belong_together_are_refused():
    short = simulate(PRESET, PULL[:10], 0.1)
    with pytest.raises(ValueError, match="as many samples"):
        twins_figure(REDUCED, [("step h", short)])
    with pytest.raises(ValueError, match="0 records of MuJoCo: must be 1 to 3"):
        twins_figure(REDUCED, [])
