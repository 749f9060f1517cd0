"""Figures show what they are given, the tables quote the right numbers, and tracks survive the disk."""

import io

import numpy as np
import pytest
from PIL import Image

from twin.estimation.registry import method_specs
from twin.evaluation.paper import INDICES, TABLES, noise_label, paper_value
from twin.evaluation.score import Score
from twin.evaluation.track import Track, load_tracks, save_tracks
from twin.report.figures import (
    loop_figure,
    rmse_figure,
    style_of,
    to_png_bytes,
    to_svg,
    tracking_figure,
    training_figure,
)
from twin.report.findings import all_findings, findings
from twin.report.tables import paper_table, paper_tables


def make_row(method: str, rmse: float, *, noise: str = "gaussian", level: float = 1.0, **changes) -> Score:
    row = {
        "noise": noise,
        "level": level,
        "sample_time_s": 0.1,
        "method": method,
        "oracle": False,
        "mae_deg": 0.7 * rmse,
        "rmse_deg": rmse,
        "md_deg": 0.6 * rmse,
        "var_deg2": 0.9 * rmse**2,
        "bias_deg": -0.1 * rmse,
        "rmse_steady_deg": rmse,
        "rmse_ci95_deg": [0.95 * rmse, 1.05 * rmse],
        "seeds": 20,
        "paper_rmse_deg": paper_value(noise, level, method, "rmse_deg"),
    }
    return Score.from_dict(row | changes)


def make_track() -> Track:
    time = np.arange(0, 20, 0.1)
    truth = 20 * np.sin(time)
    return Track("gaussian", 1.0, time, truth, truth + 0.5, {"AM": truth + 2, "RAM": truth - np.exp(-time)})


def lines_of(axes) -> list[np.ndarray]:
    return [line.get_ydata() for line in axes.get_lines()]


def test_tracking_figure_holds_estimates_above_and_errors_below():
    track = make_track()
    upper, start, lower, lower_start = tracking_figure(track, ["AM", "RAM"], "title").axes
    for axes in (upper, start):
        assert any(np.array_equal(values, track.truth_deg) for values in lines_of(axes))
        assert any(np.array_equal(values, track.estimates["RAM"]) for values in lines_of(axes))
    for axes in (lower, lower_start):
        assert any(np.allclose(values, 2.0) for values in lines_of(axes) if len(values) == len(track.time))
    assert start.get_xlim() == (0, 8)
    assert upper.get_ylabel() == "bending angle [deg]"
    with pytest.raises(ValueError, match="no estimates of 'LSTM'; there are: AM, RAM"):
        tracking_figure(track, ["LSTM"], "title")


def test_loop_figure_lays_each_fit_over_its_loop():
    pull, bend = np.linspace(-1, 1, 50), np.linspace(-20, 20, 50)
    (axes,) = loop_figure([(pull, bend)], [bend + 1]).axes
    measured, fitted = lines_of(axes)
    np.testing.assert_array_equal(fitted - measured, np.ones(50))
    with pytest.raises(ValueError, match="2 fits for 1 loops"):
        loop_figure([(pull, bend)], [bend, bend])


def test_training_figure_is_a_cost_on_a_logarithmic_axis():
    samples = np.arange(1, 101) * 1000.0
    (axes,) = training_figure({"RAM": {"samples": samples, "return": -1e3 / samples}}).axes
    assert axes.get_yscale() == "log"
    np.testing.assert_allclose(lines_of(axes)[0], 1e3 / samples)


def test_rmse_figure_has_the_interval_the_mean_and_the_paper():
    (axes,) = rmse_figure([make_row("RAM", 0.7), make_row("AM", 3.0)]).axes
    values = [value for line in lines_of(axes) for value in line]
    for expected in (0.7, 0.95 * 0.7, 1.05 * 0.7, 0.6354, 3.0, 2.8922):
        assert any(np.isclose(value, expected) for value in values)
    with pytest.raises(ValueError, match="no rows"):
        rmse_figure([])


def test_methods_are_told_apart_without_colour():
    styles = [spec.presentation.style for spec in method_specs() if spec.presentation.style]
    assert len({(style.line, style.marker) for style in styles}) == len(styles) == 7
    others = ["RAM", "KalmanNet", "UKF"]
    assert style_of("KalmanNet", others).marker != style_of("UKF", others).marker


def test_output_is_repeatable_svg_and_png_of_the_right_size():
    figure = training_figure({"RAM": {"samples": np.arange(1.0, 9), "return": -np.arange(1.0, 9)}})
    assert to_svg(figure) == to_svg(figure)
    assert to_svg(figure).rstrip().endswith("</svg>")
    assert Image.open(io.BytesIO(to_png_bytes(figure, dpi=50))).size == (280, 160)


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


def test_paper_values_of_the_published_tables():
    assert paper_value("gaussian", 5, "C-H", "var_deg2") == 12.2948
    assert paper_value("poisson", 0.1, "RAM", "mae_deg") == 0.2768
    assert paper_value("poisson", 2, "LSTM", "md_deg") == 2.1578
    assert paper_value("gaussian", 1, "Direct RL", "rmse_deg") is None
    assert paper_value("gaussian", 3, "RAM", "rmse_deg") is None
    assert noise_label("poisson-dithered", 1.0) == "Poisson dithered, λ = 1"


def test_table_cells_hold_ours_and_the_papers():
    rows = [
        make_row("RAM", 0.7, to_best_ci95=(1.05, 1.3)),
        make_row("AM-tuned", 0.61, to_best_ci95=(1.0, 1.0)),
        make_row("RAM", 9.9, sample_time_s=0.02),
        make_row("RAM", 0.5, oracle=True),
    ]
    text = paper_table(rows, "gaussian")
    (line,) = [line for line in text.splitlines() if "RMSE" in line]
    assert "0.700 (paper 0.635)" in line
    assert "0.610" in line
    assert "9.900" not in text
    assert text.splitlines()[0].split() == ["noise", "index", "AM-tuned", "RAM", "RAM", "(oracle)"]
    assert "9.900 (paper 0.635)" in paper_table(rows, "gaussian", sample_time_s=0.02)
    assert "**0.610**" in paper_table(rows, "gaussian", "markdown")  # not the oracle's 0.5
    assert "<strong>0.610</strong>" in paper_table(rows, "gaussian", "html")
    assert paper_table(rows, "poisson") == ""
    rows[0] = make_row("RAM", 0.7, to_best_ci95=(0.99, 1.3))  # they may be level
    assert "**" not in paper_table(rows, "gaussian", "markdown")


def test_both_tables_in_every_format():
    rows = [make_row("C-H", 5.0), make_row("<b>", 1.0), make_row("RAM", 2.0, noise="poisson", level=2.0)]
    for fmt in ("plain", "markdown", "html"):
        text = paper_tables(rows, fmt)
        assert "Table II" in text
        assert "Table III" in text
        assert "paper 2.133" in text
    assert "<b>" not in paper_tables(rows, "html")
    with pytest.raises(ValueError, match="valid: plain, markdown, html"):
        paper_table(rows, "gaussian", "latex")
    with pytest.raises(ValueError, match="valid: gaussian, poisson"):
        paper_table(rows, "uniform")


def test_findings_say_where_ram_loses():
    rows = [
        make_row("RAM", 0.6),
        make_row("AM", 2.0),
        make_row("AM-tuned", 0.9),
        make_row("RAM", 1.2, level=5.0),
        make_row("AM", 3.0, level=5.0),
        make_row("AM-tuned", 1.0, level=5.0),
        make_row("RAM", 0.1, level=5.0, oracle=True),
    ]
    found = findings(rows, "RAM")
    assert "the paper's comparisons (C-H, AM, LSTM) under 2 of 2 noises" in found.headline
    assert "every method tried under 1" in found.headline
    assert "best other method AM-tuned 0.900 deg (RAM -33" in found.lines[0]
    assert "best other method AM-tuned 1.000 deg (RAM +20" in found.lines[1]
    assert "intervals overlap" in findings([make_row("RAM", 0.99), make_row("AM", 1.0)], "RAM").lines[0]
    assert "do not compare" in findings([make_row("RAM", 0.6)], "RAM").headline


def test_findings_are_about_our_own_method_first_where_it_was_compared():
    """Rows that run on parts of its file are no rivals, and what it knows beyond the others is said."""
    rows = [
        make_row("RAM", 0.6),
        make_row("AM", 2.0),
        make_row("RAM (twins)", 0.4),
        make_row("RAM (twins), recogniser alone", 0.3),
    ]
    ours, of_paper = all_findings(rows)
    assert "RAM (twins) has a lower RMSE than every method tried under 1 of 1 noise" in ours.headline
    assert "best other method RAM 0.600 deg" in ours.lines[0]
    assert "simulated twins" in ours.note
    assert "best other method RAM (twins), recogniser alone" in of_paper.lines[0]
    assert not of_paper.note
    (alone,) = all_findings(rows[:2])
    assert alone.headline.startswith("RAM has")


def test_tracks_survive_the_disk(tmp_path):
    path = tmp_path / "tracks.npz"
    track = make_track()
    save_tracks(path, [track, track])
    first, second = load_tracks(path)
    for name in ("time", "truth_deg", "measurement_deg"):
        np.testing.assert_array_equal(getattr(first, name), getattr(track, name))
    assert list(second.estimates) == ["AM", "RAM"]
    np.testing.assert_array_equal(second.estimates["RAM"], track.estimates["RAM"])
    assert (first.noise, first.level) == ("gaussian", 1.0)

    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match="holds no tracks"):
        load_tracks(path)
