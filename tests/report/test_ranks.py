"""Ranks as a table and a figure."""

from twin.evaluation.ranking import MethodRank, Ranking
from twin.report.ranks import is_level, rank_figure, rank_table


def ranked(method, rmse, rank, to_best):
    return MethodRank(method, rmse, (0.9 * rmse, 1.1 * rmse), rank, rank and (rank, rank + 1), to_best, ())


FIRST = ranked("RAM (twins)", 0.32, 1, (1.0, 1.0))
LEVEL = ranked("KalmanNet", 0.33, 2, (0.98, 1.1))
BEHIND = ranked("AM", 3.0, 3, (8.0, 11.0))
BESIDE = ranked("Ensemble", 0.2, None, (0.5, 0.7))
RANKING = Ranking(0.1, (-1.0, 1.0), "nominal", (BEHIND, LEVEL, FIRST, BESIDE))


def test_the_table_has_the_least_error_first_and_says_how_sure_it_is():
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in rank_table(RANKING).splitlines()]
    assert [line[0] for line in lines[2:]] == ["Ensemble", "RAM (twins)", "KalmanNet", "AM"]
    assert lines[3] == ["RAM (twins)", "0.320 (0.288 to 0.352)", "1 (1 to 2)", "1.00 to 1.00"]
    assert lines[2][2:] == ["-", "0.50 to 0.70"]
    alone = Ranking(0.1, (), "measured", (MethodRank("AM", 0.5, None, 1, None, None, ()),))
    assert rank_table(alone).splitlines()[2].replace(" ", "") == "|AM|0.500|1|-|"


def test_level_is_who_may_be_the_first():
    assert [is_level(of) for of in (FIRST, LEVEL, BEHIND, BESIDE)] == [True, True, False, False]


def test_the_figure_has_a_panel_for_each_group_and_a_mark_for_each_method():
    other = Ranking(0.1, (2.0, 4.0), "randomised", (FIRST, BEHIND))
    figure = rank_figure([RANKING, other])
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title(loc="left") for axes in panels] == ["nominal, [-1, 1] mm", "randomised, [2, 4] mm"]
    marks = [[line for line in axes.lines if line.get_marker() in "oD"] for axes in panels]
    assert [len(of) for of in marks] == [4, 2]
    faces = {float(line.get_ydata()[0]): line.get_markerfacecolor() for line in marks[0]}
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    assert [name for place, name in enumerate(names) if faces[place] != "white"] == [
        "KalmanNet",
        "RAM (twins)",
    ]
