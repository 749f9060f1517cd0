"""Figures show the numbers that they are given, in styles that differ without colour."""

import dataclasses

import numpy as np
import pytest
from scores import SCORE, track

from twin.evaluation.ranking import MethodRank, Ranking
from twin.evaluation.results import load_tracks, save_tracks
from twin.report.figures import is_level, paper_figures, rank_figure, rmse_figure, tracking_figure

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


def test_rmse_figure_has_the_interval_the_mean_and_the_paper():
    rows = [
        dataclasses.replace(SCORE, rmse_deg=0.7, rmse_ci95_deg=(0.6, 0.8), paper_rmse_deg=0.6354),
        dataclasses.replace(SCORE, method="AM", rmse_deg=3.0, paper_rmse_deg=2.8922),
    ]
    (axes,) = rmse_figure(rows).axes
    values = [value for line in lines_of(axes) for value in line]
    for expected in (0.7, 0.6, 0.8, 0.6354, 3.0, 2.8922):
        assert any(np.isclose(value, expected) for value in values)
    with pytest.raises(ValueError, match="no rows"):
        rmse_figure([])


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


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_papers_figures_have_its_numbers_methods_and_figures():
    score = dataclasses.replace(SCORE, level=5.0, rmse_deg=1.337, paper_rmse_deg=1.0444)
    elsewhere = dataclasses.replace(score, rmse_deg=9.0, stroke_mm=(-4.0, 4.0))
    figures = paper_figures(tracks(NOISES), [score, elsewhere])
    assert list(figures) == [5, 6, 7, 8, 9, 10]
    assert legend(figures[5][0])[2:] == ["Direct RL", "RAM"]
    for number in (6, 8, 9, 10):
        assert legend(figures[number][0])[2:] == ["C-H", "AM", "LSTM", "RAM"]
    assert "RAM: 1.34 (paper 1.04)" in legend(figures[7][0])
    assert figures[10][1].startswith("As the paper's Fig. 10: C-H, AM, LSTM, RAM under Poisson, λ = 2.")
    of_another = paper_figures(tracks(NOISES[1:2]), [dataclasses.replace(score, paper_rmse_deg=None)])
    assert "RAM: 1.34" in legend(of_another[7][0])
    assert list(paper_figures(tracks(NOISES[:1], ("C-H",)))) == [6]  # Fig. 5 has other methods


def ranked(method, rmse, rank, to_best):
    return MethodRank(method, rmse, (0.9 * rmse, 1.1 * rmse), rank, rank and (rank, rank + 1), to_best, ())


FIRST = ranked("RAM (twins)", 0.32, 1, (1.0, 1.0))
LEVEL = ranked("KalmanNet", 0.33, 2, (0.98, 1.1))
WORSE = ranked("AM", 3.0, 3, (8.0, 11.0))
APART = ranked("Ensemble", 0.2, None, (0.5, 0.7))


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
