import dataclasses
import itertools

import numpy as np
import pytest

from twin.evaluation.costs import Cost
from twin.evaluation.score import Score
from twin.evaluation.track import Track
from twin.report.limit import times_the_limit
from twin.report.overall import overall_table
from twin.report.summary import benchmark_figures, benchmark_tables

NOISES = [("gaussian", 1.0), ("poisson", 2.0)]
FIRST = ((-1.0, 1.0), "nominal")
LIMIT = "Ensemble (limit)"


def row(method, noise, T, group, rmse):
    stroke, twin = group
    return Score(
        noise=noise[0],
        level=noise[1],
        sample_time_s=T,
        stroke_mm=stroke,
        twin=twin,
        method=method,
        oracle="oracle" in method,
        mae_deg=rmse,
        rmse_deg=rmse,
        md_deg=rmse,
        var_deg2=rmse,
        bias_deg=0.0,
        rmse_steady_deg=rmse / 2,
        rmse_ci95_deg=(0.9 * rmse, 1.1 * rmse),
        seeds=2,
        to_best_ci95=(1.0, 1.0) if method == "RAM" else (1.5, 9.0),
    )


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
        row(method, noise, T, group, rmse * (1 if T == 0.1 else 0.5))
        for T, group in itertools.product((0.1, 0.02), groups)
        for place, noise in enumerate(NOISES)
        for method, rmse in ((name, values[place]) for name, values in figures.items())
    ]


BOUNDS = [
    {"noise": "gaussian", "level": 1.0, "sample_time_s": 0.1, "stroke_mm": [-1.0, 1.0], "rmse_deg": 0.45}
]


def test_distance_to_the_limit_is_the_geometric_mean_over_noises(rows):
    ratios = times_the_limit(rows, 0.1, FIRST)
    assert ratios[LIMIT] == pytest.approx(1.0)
    assert ratios["AM"] == pytest.approx(np.sqrt(8 * 16))
    assert ratios["RAM"] == pytest.approx(np.sqrt(2 * 4))


def test_the_best_that_neither_sees_the_truth_nor_knows_the_physics_is_bold(rows):
    text = benchmark_tables(rows, BOUNDS)
    first = text.split("### ")[3]  # behind the whole at both sample times
    assert first.startswith(
        "RMSE [deg] ± half its 95 % interval over noise seeds, nominal, [-1, 1] mm, T = 0.1 s"
    )
    lines = {line.split("|")[1].strip(): line for line in first.splitlines() if line.startswith("| ")}
    assert "**1.000 ± 0.100**" in lines["RAM"]
    assert "**" not in lines["AM"] + lines["RAM (oracle)"] + lines["Ensemble"] + lines[LIMIT]
    level = [dataclasses.replace(of, to_best_ci95=(0.9, 1.1)) if of.method == "AM" else of for of in rows]
    assert "**" not in benchmark_tables(level, BOUNDS).split("### ")[3]
    # The whole and one group at two sample times, without the start, ratios at both, bounds, the paper's.
    assert text.count("### ") == 2 + 2 + 1 + 2 + 1 + 1


def test_the_whole_is_a_line_for_each_method_the_least_error_on_top(rows):
    held = [dataclasses.replace(of, coverage95=0.9) if of.method == "RAM" else of for of in rows]
    held = [
        dataclasses.replace(of, rmse_deg=4 * of.rmse_deg)
        if (of.method, of.twin) == ("AM", "randomized")
        else of
        for of in held
    ]
    lines = overall_table(held, 0.1, {"RAM": Cost(12.4, 4321, 90.0), "AM": Cost()}).splitlines()
    cells = {line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in lines}
    assert list(cells)[2:] == ["RAM (oracle)", LIMIT, "Ensemble", "RAM", "AM"]
    assert cells["method"][:4] == ["the preset", "randomized", "all", "times the limit"]
    preset, randomised = np.sqrt(4 * 8), 4 * np.sqrt(4 * 8)
    whole = np.sqrt(preset * randomised)
    assert cells["AM"] == [
        *(f"{of:.2f}" for of in (preset, randomised, whole, whole / 0.5)),
        "-",
        "1",
        *"---",
    ]
    assert cells["RAM"] == ["1.41", "1.41", "1.41", "2.83", "90", "1", "1.5", "4321", "12"]
    without = [of for of in rows if of.method != LIMIT]
    assert "limit" not in overall_table(without, 0.1, {})


def test_the_bound_stands_beside_the_limit_over_randomised_twins(rows):
    bounds = [BOUNDS[0] | {"stroke_mm": [2.0, 4.0]}]
    assert "0.500 / 0.450" in benchmark_tables(rows, bounds)
    assert "- / 0.450" in benchmark_tables(rows, BOUNDS)  # the nominal twin is not drawn


def test_methods_are_listed_from_the_nearest_to_the_limit(rows):
    ratios = (
        benchmark_tables(rows, BOUNDS)
        .split("### Times the limit: geometric mean over noises, T = 0.1 s")[1]
        .split("###")[0]
    )
    names = [line.split("|")[1].strip() for line in ratios.splitlines() if line.startswith("| ")][1:]
    assert names == ["RAM (oracle)", LIMIT, "Ensemble", "RAM", "AM"]


def test_without_the_limit_there_is_no_distance_to_it(rows):
    others = [row for row in rows if row.method != LIMIT]
    assert "Times the limit" not in benchmark_tables(others, [])
    time = np.arange(30) * 0.1
    track = Track("gaussian", 1.0, time, time, time + 1, {"AM": time + 0.5})
    assert set(benchmark_figures(others, [track])) == {"rmse_by_noise.png", "figure_06.png"}


def test_figures_are_pictures_and_those_of_the_paper_carry_its_numbers(rows):
    time = np.arange(30) * 0.1
    track = Track("gaussian", 1.0, time, time, time + 1, {"AM": time + 0.5, "RAM": time + 0.1})
    figures = benchmark_figures(rows, [track])
    assert set(figures) == {"rmse_by_noise.png", "times_the_limit.png", "figure_05.png", "figure_06.png"}
    assert all(picture.startswith(b"\x89PNG") for picture in figures.values())


def test_where_a_method_has_several_trainings_their_spread_is_shown(rows):
    several = [dataclasses.replace(row, training_rmse_deg=(0.9, 1.1)) for row in rows]
    text = benchmark_tables(several, BOUNDS)
    assert "interval over noise seeds and trainings, nominal" in text
    assert "### Trainings that differ in their seed alone" in text
