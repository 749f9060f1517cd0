"""Stated intervals in a table and a figure: who states one, in which order, and by which figures."""

import dataclasses

from scores import SCORE

from twin.report.figures import to_png_bytes
from twin.report.intervals import interval_figure, interval_scores, interval_table

STATED = {"coverage95": 0.94, "width95_deg": 1.5, "nees": 1.1, "nis": 1.2, "crps_deg": 0.2}
SCORES = [
    dataclasses.replace(SCORE, method="LSTM"),
    dataclasses.replace(SCORE, method="AM", **STATED),
    dataclasses.replace(SCORE, method="AM", noise="poisson", **STATED | {"coverage95": 0.5, "crps_deg": 0.8}),
    dataclasses.replace(SCORE, method="RAM (twins)", **STATED | {"crps_deg": 0.1}),
]


def test_methods_that_state_an_interval_the_best_first():
    assert list(interval_scores(SCORES)) == ["RAM (twins)", "AM"]
    assert interval_scores(SCORES[:1]) == {}


def test_the_table_has_coverage_by_noise_and_means_of_the_rest():
    lines = [line.strip("|").split("|") for line in interval_table(SCORES).splitlines()]
    head, _, first, second = ([cell.strip() for cell in line] for line in lines)
    assert head[-4:] == ["width [deg]", "NEES", "NIS", "CRPS [deg]"]
    assert first == ["RAM (twins)", "94", "-", "1.50", "1.10", "1.20", "0.100"]
    assert second == ["AM", "94", "50", "1.50", "1.10", "1.20", "0.400"]
    assert interval_table(SCORES[:1]) == ""


def test_the_figure_has_a_dot_for_each_noise():
    coverage, worth = interval_figure(SCORES).axes
    assert [tick.get_text() for tick in coverage.get_yticklabels()] == ["AM", "RAM (twins)"]
    assert list(coverage.lines[0].get_xdata()) == [0.94, 0.5]
    assert list(worth.lines[0].get_xdata()) == [0.2, 0.8]
    assert to_png_bytes(interval_figure(SCORES), dpi=40).startswith(b"\x89PNG")
