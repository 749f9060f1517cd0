"""Figures show the numbers that they are given, in styles that differ without colour."""

import dataclasses
import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from scores import SCORE, track

from twin.evaluation.ranking import MethodRank, Ranking
from twin.evaluation.results import load_tracks, save_tracks
from twin.files.atomic import MADE_BY
from twin.report.figures import (
    COLUMN,
    PAGE,
    comparison_figures,
    is_level,
    noise_figure,
    paper_figures,
    rank_figure,
    to_bytes,
    tracking_figure,
)

TIME = np.arange(0, 20, 0.1)
TRUTH = 20 * np.sin(TIME)
TRACK = track(TIME, TRUTH, TRUTH + 0.5, {"AM": TRUTH + 2, "RAM": TRUTH - np.exp(-TIME)})
METHODS = ("C-H", "AM", "LSTM", "Direct RL", "RAM")
NOISES = [("gaussian", 1.0), ("gaussian", 5.0), *(("poisson", level) for level in (0.1, 1.0, 2.0))]


def lines_of(axes) -> list[np.ndarray]:
    return [line.get_ydata() for line in axes.get_lines()]


def test_tracking_figure_holds_estimates_above_and_errors_below():
    upper, start, lower, lower_start = tracking_figure(TRACK, ["AM", "RAM"], "title").axes
    for axes in (upper, start):
        assert any(np.array_equal(values, TRUTH) for values in lines_of(axes))
        assert any(np.array_equal(values, TRACK.estimates["RAM"]) for values in lines_of(axes))
    for axes in (lower, lower_start):
        assert any(np.allclose(values, 2.0) for values in lines_of(axes) if len(values) == len(TIME))
    assert start.get_xlim() == (0, 8)
    with pytest.raises(ValueError, match="no estimates of 'LSTM'; there are: AM, RAM"):
        tracking_figure(TRACK, ["LSTM"], "title")


def test_noise_figure_has_the_interval_the_mean_and_the_paper_the_least_mean_on_top():
    rows = [
        dataclasses.replace(SCORE, rmse_deg=0.7, rmse_ci95_deg=(0.6, 0.8), paper_rmse_deg=0.6354),
        dataclasses.replace(SCORE, method="AM", rmse_deg=3.0, paper_rmse_deg=2.8922),
    ]
    (axes,) = noise_figure(rows).axes
    values = [value for line in axes.get_lines() for value in np.atleast_1d(line.get_xdata())]
    for expected in (0.7, 0.6, 0.8, 0.6354, 3.0, 2.8922):
        assert any(np.isclose(value, expected) for value in values)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["AM", "RAM"]  # from below
    with pytest.raises(ValueError, match="no rows"):
        noise_figure([])


def test_tracks_survive_the_disk(tmp_path):
    path = tmp_path / "tracks.npz"
    save_tracks(path, {("gaussian", 1.0): TRACK, ("poisson", 2.0): TRACK})
    first, second = load_tracks(path).values()
    for name in ("time", "truth_deg", "measured_deg"):
        np.testing.assert_array_equal(getattr(first, name), getattr(TRACK, name))
    assert list(second.estimates) == ["AM", "RAM"]
    np.testing.assert_array_equal(second.estimates["RAM"], TRACK.estimates["RAM"])
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match="holds no tracks"):
        load_tracks(path)


def tracks(noises, methods=METHODS):
    return dict.fromkeys(noises, track(TIME, TRUTH, TRUTH, dict.fromkeys(methods, TRUTH)))


def labels(figure):
    """Texts next to the lines, from below, the methods' before those of the angles."""
    found = sorted(figure.axes[-1].texts, key=lambda text: text.xyann[1])
    return [text.get_text() for text in found]


def test_the_papers_figures_have_its_numbers_methods_and_figures():
    score = dataclasses.replace(SCORE, level=5.0, rmse_deg=1.337, paper_rmse_deg=1.0444)
    elsewhere = dataclasses.replace(score, rmse_deg=9.0, stroke_mm=(-4.0, 4.0))
    figures = paper_figures(tracks(NOISES), [score, elsewhere])
    assert list(figures) == [5, 6, 7, 8, 9, 10]
    assert sorted(labels(figures[5][0])) == ["Direct RL", "RAM"]
    for number in (6, 8, 9, 10):
        assert sorted(labels(figures[number][0])) == ["AM", "C-H", "LSTM", "RAM"]
    assert {"RAM  1.34 (1.04)", "RMSE [deg] (paper)"} < set(labels(figures[7][0]))
    assert figures[10][1].startswith("As the paper's Fig. 10: C-H, AM, LSTM, RAM under Poisson, λ = 2.")
    of_another = paper_figures(tracks(NOISES[1:2]), [dataclasses.replace(score, paper_rmse_deg=None)])
    assert {"RAM  1.34", "RMSE [deg]"} < set(labels(of_another[7][0]))
    assert list(paper_figures(tracks(NOISES[:1], ("C-H",)))) == [6]  # Fig. 5 has other methods


def ranked(method, rmse, rank, best_rank, to_best):
    return MethodRank(method, rmse, (0.9 * rmse, 1.1 * rmse), rank, rank and (best_rank, 3), to_best, ())


FIRST = ranked("RAM (twins)", 0.32, 1, 1, (1.0, 1.0))
LEVEL = ranked("KalmanNet", 0.33, 2, 1, (0.98, 1.1))
WORSE = ranked("AM", 3.0, 3, 3, (8.0, 11.0))
APART = ranked("Ensemble (limit)", 0.2, None, None, (0.5, 0.7))


def test_rank_figure_has_a_panel_for_each_group_and_fills_the_level_ones():
    assert [is_level(of) for of in (FIRST, LEVEL, WORSE, APART)] == [True, True, False, False]
    rankings = [
        Ranking(0.1, (-1.0, 1.0), "nominal", (WORSE, LEVEL, FIRST, APART)),
        Ranking(0.1, (2.0, 4.0), "randomised", (FIRST, WORSE)),
    ]
    panels = [axes for axes in rank_figure(rankings).axes if axes.get_visible()]
    assert [axes.get_title(loc="left") for axes in panels] == ["nominal, [-1, 1] mm", "randomised, [2, 4] mm"]
    marks = [[line for line in axes.lines if line.get_marker() in "oD"] for axes in panels]
    assert [len(of) for of in marks] == [4, 2]
    faces = {float(line.get_ydata()[0]): line.get_markerfacecolor() for line in marks[0]}
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    filled = [name for place, name in enumerate(names) if faces[place] != "white"]
    assert filled == ["KalmanNet", "RAM (twins)"]


SCORES = [
    dataclasses.replace(
        SCORE,
        noise=noise,
        level=level,
        method=method,
        oracle="oracle" in method,
        rmse_deg=rmse,
        rmse_ci95_deg=(0.9 * rmse, 1.1 * rmse),
        paper_rmse_deg=2 * rmse,
        coverage95=0.9,
        crps_deg=rmse / 2,
    )
    for noise, level in NOISES
    for method, rmse in (
        ("KalmanNet and bias (twins)", 0.3),
        ("AM", 3.0),
        ("RAM", 0.6),
        ("RAM (oracle)", 0.1),
    )
]


def test_the_best_deployable_method_is_in_every_figure():
    best = "KalmanNet and bias (twins)"
    rankings = [Ranking(0.1, (-1.0, 1.0), "nominal", (ranked(best, 0.3, 1, 1, (1.0, 1.0)), WORSE))]
    figures = comparison_figures(SCORES, tracks(NOISES, (*METHODS, best)), rankings)
    assert len(figures) == 2 * (3 + 6)
    for name, figure in figures.items():
        texts = {text.get_text() for axes in figure.axes for text in (*axes.texts, *axes.get_yticklabels())}
        assert any(text.startswith(best) for text in texts), name
        assert figure.get_figwidth() == (COLUMN if name.endswith("_column") else PAGE)


@pytest.fixture
def written(monkeypatch):
    """Texts that are really drawn, by their boxes: a tick beyond the limits of its axis is not."""
    boxes: dict[Text, Bbox] = {}
    draw = Text.draw

    def record(text, renderer):
        if text.get_text() and text.get_visible():
            boxes[text] = Text.get_window_extent(text, renderer)
        draw(text, renderer)

    monkeypatch.setattr(Text, "draw", record)
    return boxes


@pytest.mark.parametrize("width", [COLUMN, PAGE])
@pytest.mark.parametrize("kind", ["tracking", "noise", "rank"])
def test_no_two_texts_overlap_and_none_is_cut_off(written, kind, width):
    """Six methods that end at one point, long names, and the labels of all panels."""
    if kind == "tracking":
        many = track(TIME, TRUTH, TRUTH, dict.fromkeys([*METHODS, "KalmanNet and bias (twins)"], TRUTH))
        figure = tracking_figure(many, list(many.estimates), "title", {"RAM": "0.64 (0.64)"}, width)
    elif kind == "noise":
        figure = noise_figure(SCORES, width)
    else:
        figure = rank_figure([Ranking(0.1, (-1.0, 1.0), "nominal", (FIRST, LEVEL, WORSE, APART))], width)
    figure.draw(FigureCanvasAgg(figure).get_renderer())
    assert len(written) > 10
    for text, box in written.items():
        assert figure.bbox.padded(2).count_contains(box.corners()) == 4, text
    for (first, one), (second, other) in itertools.combinations(written.items(), 2):
        assert not one.padded(-1).overlaps(other.padded(-1)), (first, second)


@pytest.mark.parametrize(("kind", "begin"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF-")])
def test_a_file_of_a_figure_is_recognised_as_ours_and_the_same_each_time(kind, begin):
    first, again = (to_bytes(noise_figure(SCORES[:2]), kind) for _ in range(2))
    assert first.startswith(begin)
    assert MADE_BY.encode() in first[:65536] + first[-65536:]
    assert first == again
