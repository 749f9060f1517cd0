import numpy as np
import pytest

from twin.evaluation.score import Score
from twin.evaluation.track import Track
from twin.report.paper_figures import paper_figures

TIME = np.arange(40) * 0.1
METHODS = ("C-H", "AM", "LSTM", "Direct RL", "RAM")


def track(noise, level, methods=METHODS):
    return Track(noise, level, TIME, TIME, TIME + 1, {name: TIME + 0.1 for name in methods})


ALL = [
    track("gaussian", 1.0),
    track("gaussian", 5.0),
    *(track("poisson", level) for level in (0.1, 1.0, 2.0)),
]


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_figures_have_the_papers_numbers_and_show_its_methods():
    figures = paper_figures(ALL)
    assert list(figures) == [5, 6, 7, 8, 9, 10]
    assert legend(figures[5][0])[2:] == ["Direct RL", "RAM"]
    for number in range(6, 11):
        assert legend(figures[number][0])[2:] == ["C-H", "AM", "LSTM", "RAM"]
    assert figures[10][1].startswith("As the paper's Fig. 10: C-H, AM, LSTM, RAM under Poisson, λ = 2.")


def test_our_rmse_stands_beside_the_published_one():
    here = {"sample_time_s": 0.1, "stroke_mm": [-1.0, 1.0], "twin": "nominal"}
    rest = dict.fromkeys(("mae_deg", "md_deg", "var_deg2", "bias_deg", "rmse_steady_deg"), 0.0)
    rest |= {"oracle": False, "rmse_ci95_deg": [0.0, 9.0], "seeds": 1}
    rows = [
        {
            "noise": "gaussian",
            "level": 5.0,
            "method": "RAM",
            "rmse_deg": 1.337,
            **here,
            **rest,
            "paper_rmse_deg": 1.0444,
        },
        {"noise": "gaussian", "level": 1.0, "method": "Direct RL", "rmse_deg": 1.2, **here, **rest},
    ]
    # The tracks are of the first records at the longest sample time: other rows are not theirs.
    rows += [rows[0] | {"rmse_deg": 9.0, "stroke_mm": [-4.0, 4.0]}]
    rows += [rows[0] | {"rmse_deg": 9.0, "sample_time_s": 0.02}]
    figures = paper_figures(ALL, [Score.from_dict(row) for row in rows])
    assert "RAM: 1.34 (paper 1.04)" in legend(figures[7][0])
    assert "Direct RL: 1.20" in legend(figures[5][0])  # of which the paper has no figure
    other = [Score.from_dict(row | {"paper_rmse_deg": None}) for row in rows]  # of another instrument
    assert "RAM: 1.34" in legend(paper_figures(ALL, other)[7][0])


@pytest.mark.parametrize("missing", ["noise", "method"])
def test_what_was_not_evaluated_is_left_out(missing):
    tracks = ALL[1:] if missing == "noise" else [track("gaussian", 1.0, ("C-H",)), *ALL[1:]]
    figures = paper_figures(tracks)
    assert 5 not in figures
    assert (6 in figures) == (missing == "method")
    assert 7 in figures
