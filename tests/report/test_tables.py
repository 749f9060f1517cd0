"""Tables quote the right numbers, name the best only beyond doubt, and hold means over the right axes."""

import dataclasses
import itertools

import numpy as np
import pytest
from scores import SCORE

from twin.evaluation.costs import Cost
from twin.evaluation.paper import INDICES, TABLES, paper_value
from twin.evaluation.ranking import MethodRank, Ranking
from twin.report.tables import (
    best_deployable,
    best_two,
    comparison_tables,
    front_scores,
    overall_table,
    paper_table,
    paper_tables,
    rank_table,
    times_the_limit,
    training_table,
)

NOISES = [("gaussian", 1.0), ("poisson", 2.0)]
FIRST = ((-1.0, 1.0), "nominal")
LIMIT = "Ensemble (limit)"
BOUND = {"noise": "gaussian", "level": 1.0, "sample_time_s": 0.1, "stroke_mm": [-1.0, 1.0], "rmse_deg": 0.45}


def row(method, rmse, noise=NOISES[0], T=0.1, group=FIRST, **changes):
    values = {
        "method": method,
        "noise": noise[0],
        "level": noise[1],
        "sample_time_s": T,
        "stroke_mm": group[0],
        "twin": group[1],
        "oracle": "oracle" in method,
        "rmse_deg": rmse,
        "rmse_ci95_deg": (0.9 * rmse, 1.1 * rmse),
        "paper_rmse_deg": paper_value(*noise, method, "rmse_deg"),
        "is_best": method == "RAM",
    }
    return dataclasses.replace(SCORE, **values | changes)


@pytest.fixture
def rows():
    figures = {
        "AM": (4.0, 8.0),
        "RAM": (1.0, 2.0),
        "RAM (oracle)": (0.1, 0.1),
        "Ensemble": (0.6, 2.0),
        LIMIT: (0.5, 0.5),
    }
    groups = [FIRST, ((2.0, 4.0), "randomized")]
    return [
        row(method, rmse * (1 if T == 0.1 else 0.5), noise, T, group)
        for T, group in itertools.product((0.1, 0.02), groups)
        for place, noise in enumerate(NOISES)
        for method, rmse in ((name, values[place]) for name, values in figures.items())
    ]


def cells_of(table: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in table.splitlines()
        if line.startswith("|")
    ]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.number)
def test_the_papers_figures_agree_with_one_another(table):
    """RMSE^2 >= Var, RMSE >= MAE: a slip in copying a number would break one of them."""
    for level, values in table.values.items():
        assert set(values) == set(INDICES)
        for method in ("C-H", "AM", "LSTM", "RAM"):
            mae, rmse, var = (
                paper_value(table.noise, level, method, index)
                for index in ("mae_deg", "rmse_deg", "var_deg2")
            )
            assert rmse >= mae
            if method in ("C-H", "RAM") and level != 5.0:
                assert var <= rmse**2 * 1.001


def test_table_cells_hold_ours_and_the_papers():
    scores = [
        row("RAM", 0.7, is_best=False),
        row("AM-tuned", 0.61, is_best=True),
        row("RAM", 9.9, T=0.02),
        row("RAM", 0.5, oracle=True, is_best=False),
    ]
    text = paper_table(scores, "gaussian")
    (line,) = [line for line in text.splitlines() if "RMSE" in line]
    assert "0.700 (paper 0.635)" in line
    assert "0.610" in line
    assert "9.900" not in text
    assert text.splitlines()[0].split() == ["noise", "index", "AM-tuned", "RAM", "RAM", "(oracle)"]
    assert "9.900 (paper 0.635)" in paper_table(scores, "gaussian", sample_time_s=0.02)
    assert "**0.610**" in paper_table(scores, "gaussian", "markdown")  # not the oracle's 0.5
    assert paper_table(scores, "poisson") == ""
    scores[1] = row("AM-tuned", 0.61, is_best=False)  # they may be level
    assert "**" not in paper_table(scores, "gaussian", "markdown")
    both = paper_tables([*scores, row("RAM", 2.0, ("poisson", 2.0))])
    assert "Table II:" in both
    assert "paper 2.133" in both.partition("Table III:")[2]
    with pytest.raises(ValueError, match="valid: gaussian, poisson"):
        paper_table(scores, "uniform")


def test_the_ratio_to_the_limit_is_the_geometric_mean_over_noises(rows):
    ratios = times_the_limit(rows, [0.1], [FIRST])
    assert ratios[LIMIT] == pytest.approx(1.0)
    assert ratios["AM"] == pytest.approx(np.sqrt(8 * 16))
    assert ratios["RAM"] == pytest.approx(np.sqrt(2 * 4))
    title = "### Times the limit: geometric mean over noises, T = 0.1 s"
    listed = cells_of(comparison_tables(rows, []).split(title)[1].split("###")[0])
    assert [line[0] for line in listed[2:]] == ["RAM (oracle)", LIMIT, "Ensemble", "RAM", "AM"]


def test_the_best_that_knows_neither_the_truth_nor_the_density_is_bold(rows):
    text = comparison_tables(rows, [BOUND])
    first = text.split("### ")[3]  # after the means at both sample times
    lines = {line[0]: "".join(line) for line in cells_of(first)}
    assert "**1.000 ± 0.100**" in lines["RAM"]
    assert "**" not in lines["AM"] + lines["RAM (oracle)"] + lines["Ensemble"] + lines[LIMIT]
    level = [dataclasses.replace(of, is_best=False) for of in rows]
    assert "**" not in comparison_tables(level, [BOUND]).split("### ")[3]
    # Means and one group at two sample times, one without the start, ratios at both, bounds, the paper's.
    assert text.count("### ") == 2 + 2 + 1 + 2 + 1 + 1


def test_the_mean_over_all_is_a_line_for_each_method_the_least_error_on_top(rows):
    held = [dataclasses.replace(of, coverage95=0.9) if of.method == "RAM" else of for of in rows]
    held = [
        dataclasses.replace(of, rmse_deg=4 * of.rmse_deg)
        if (of.method, of.twin) == ("AM", "randomized")
        else of
        for of in held
    ]
    costs = {"RAM": Cost(12.4, 4321, 90.0), "AM": Cost()}
    head, _, *lines = cells_of(overall_table(held, 0.1, costs))
    assert [line[0] for line in lines] == ["RAM (oracle)", LIMIT, "Ensemble", "RAM", "AM"]
    assert head[1:5] == ["the preset", "randomized", "all", "times the limit"]
    preset, randomised = np.sqrt(4 * 8), 4 * np.sqrt(4 * 8)
    mean = np.sqrt(preset * randomised)
    assert lines[4][1:5] == [f"{of:.2f}" for of in (preset, randomised, mean, mean / 0.5)]
    assert lines[4][5:] == ["-", "1", *"---"]
    assert lines[3][1:] == ["1.41", "1.41", "1.41", "2.83", "90", "1", "1.5", "4321", "12"]
    assert "limit" not in overall_table([of for of in rows if of.method != LIMIT], 0.1, {})


def test_the_bound_is_compared_with_the_limit_over_randomised_twins(rows):
    assert "0.500 / 0.450" in comparison_tables(rows, [BOUND | {"stroke_mm": [2.0, 4.0]}])
    assert "- / 0.450" in comparison_tables(rows, [BOUND])  # the nominal twin is not drawn


def test_figures_of_trainings_are_geometric_means_over_noises_of_each():
    rows = [
        row("GRU", 1.0, training_rmse_deg=(0.5, 2.0, 1.0)),
        row("GRU", 1.0, ("poisson", 1.0), training_rmse_deg=(2.0, 2.0, 4.0)),
        row("GRU", 1.0, T=0.02, training_rmse_deg=(1.0, 2.0)),
        row("AM", 1.0),
    ]
    first, second = cells_of(training_table(rows, "markdown"))[2:]
    assert first[:3] == ["GRU", "nominal, [-1, 1] mm", "0.1 s"]
    assert second[:4] == ["GRU", "nominal, [-1, 1] mm", "0.02 s", "2"]
    each = np.array([1.0, 2.0, 2.0])  # roots of 0.5 x 2, 2 x 2, 1 x 4
    mean = each.mean()
    expected = [3, mean, each.std(ddof=1), each.min(), each.max(), 100 * (each.max() / mean - 1)]
    assert [float(cell.strip("% ")) for cell in first[3:]] == pytest.approx(expected, abs=0.06)
    assert training_table(rows[3:]) == ""
    text = comparison_tables(rows[:2], [])
    assert "interval over noise seeds and trainings, nominal" in text
    assert "### Trainings that differ in their seed alone" in text


def test_the_table_of_ranks_has_the_least_error_first_and_its_intervals():
    ranked = (
        MethodRank("AM", 3.0, (2.7, 3.3), 2, (2, 3), (8.0, 11.0)),
        MethodRank("RAM (twins)", 0.32, (0.288, 0.352), 1, (1, 2), (1.0, 1.0)),
        MethodRank(LIMIT, 0.2, None, None, None, (0.5, 0.7)),
    )
    lines = cells_of(rank_table(Ranking(0.1, (-1.0, 1.0), "nominal", ranked)))[2:]
    assert lines[0] == [LIMIT, "0.200", "-", "0.50 to 0.70"]
    assert lines[1] == ["RAM (twins)", "0.320 (0.288 to 0.352)", "1 (1 to 2)", "1.00 to 1.00"]
    assert lines[2][0] == "AM"


def test_the_best_that_can_be_deployed_is_no_oracle_and_no_yardstick():
    scores = [row("RAM", 0.7), row("AM", 0.8), row("RAM (oracle)", 0.1), row(LIMIT, 0.2)]
    assert best_deployable([*scores, row("Ensemble", 0.6)]) == "Ensemble"
    assert best_deployable(scores) == "RAM"
    assert best_deployable(scores[2:]) is None


def test_the_next_best_is_no_part_of_the_same_file():
    scores = [row("RAM (twins), filter alone", 0.6), row("RAM (twins)", 0.7), row("AM", 0.8), row(LIMIT, 0.2)]
    assert best_two(scores) == ["RAM (twins), filter alone", "AM"]
    assert best_two(scores[:2]) == ["RAM (twins), filter alone"]
    assert best_two(scores[3:]) == []


def test_a_first_look_has_the_papers_noises_its_methods_and_the_best():
    names = ["C-H", "AM", "AM-tuned", "LSTM", "Direct RL", "RAM", "RAM (oracle)", "Huber", "VB", "GRU"]
    noises = [("uniform", 1.0), ("poisson", 2.0), ("poisson-dithered", 2.0), ("gaussian", 1.0)]
    noises += [("poisson-dithered", 1.0)]
    scores = [row(name, 1.0 + place, noise) for noise in noises for place, name in enumerate(names)]
    scores += [row("GRU", 0.5, group=((2.0, 4.0), "nominal"))]
    scores = [dataclasses.replace(of, rmse_deg=0.1) if of.method == "VB" else of for of in scores]
    front = front_scores(scores)
    assert {of.method for of in front} == {*names} - {"Huber", "GRU"}
    papers = [("gaussian", 1.0), ("poisson-dithered", 1.0), ("poisson", 2.0)]  # dithered where it is alone
    assert list(dict.fromkeys(of.condition for of in front)) == papers
    few = [of for of in scores if of.method in ("AM", "Huber", "VB") and of.noise == "uniform"]
    assert front_scores(few) == few
