"""An episode in a notebook: as a table of pandas, as a figure, and in HTML."""

import csv
import dataclasses
import io
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image
from recorded import make_episode

import twin
from twin.recording import write_episode
from twin.recording.features import csv_text, statistics


def test_a_dataframe_has_the_columns_and_doubles_of_the_table():
    episode = make_episode(planes=2, drive=True)
    frame = episode.to_dataframe()
    header, *rows = csv.reader(io.StringIO(csv_text(episode, everything=True)))
    assert list(frame.columns) == header
    np.testing.assert_array_equal(frame.to_numpy(), np.array(rows, dtype=float))
    np.testing.assert_array_equal(frame["bend_deg"], np.degrees(episode.bend))
    np.testing.assert_array_equal(frame["wire_tension_d_2_n"], episode.wire_tension[:, 3, 2])


def test_a_dataset_is_its_episodes_and_a_row_of_parameters_for_each(tmp_path):
    for seed in (3, 4):
        episode = make_episode(seed=seed, vertebrae=seed)
        episode.metadata["statistics"] = statistics(episode)
        write_episode(tmp_path / f"{seed}.mcap", episode)
    dataset = twin.read_dataset(tmp_path)
    frame = dataset.to_dataframe()
    assert [len(dataset), len(frame)] == [2, 2]
    assert [list(frame["seed"]), list(frame["preset.vertebrae"])] == [[3, 4], [3, 4]]
    assert not [name for name in frame.columns if name.startswith("statistics")]


def test_a_figure_has_the_loop_and_both_courses_with_units():
    episode = make_episode(40)
    figure = episode.plot()
    loop, bend, pull = figure.axes
    x, y = loop.lines[1].get_data()
    np.testing.assert_array_equal([x, y], [episode.pull_mm, episode.truth_deg])
    np.testing.assert_array_equal(loop.lines[0].get_ydata(), episode.measured_deg)
    np.testing.assert_array_equal(bend.lines[1].get_data(), [episode.time, episode.truth_deg])
    np.testing.assert_array_equal(pull.lines[0].get_data(), [episode.time, episode.pull_mm])
    assert all("[" in label for axes in (loop, pull) for label in (axes.get_xlabel(), axes.get_ylabel()))
    with Image.open(io.BytesIO(figure._repr_png_())) as picture:
        assert picture.format == "PNG"


def test_the_figure_of_a_log_has_no_truth_and_its_name_is_no_mathematics():
    facts = {"source": "measured", "name": r"a $\frac{$ b"}
    figure = dataclasses.replace(make_episode(40), metadata=facts).plot()
    assert [len(axes.lines) for axes in figure.axes] == [1, 1, 1]
    assert figure._repr_png_()


@pytest.mark.parametrize("samples", [2, 5000])
def test_html_has_a_small_loop_and_escaped_text(samples):
    facts = {"name": "<script>alert(1)</script> & more"}
    episode = dataclasses.replace(make_episode(samples), metadata=facts)
    tree = ET.fromstring(episode._repr_html_())
    assert {element.tag for element in tree.iter()} == {"div", "svg", "title", "polyline", "pre"}
    assert tree.find("pre").text == repr(episode)
    points = [point.split(",") for point in tree.find("svg/polyline").get("points").split()]
    x, y = np.array(points, dtype=float).T
    assert min(samples, 400) <= len(points) <= 500
    assert 0 < x.min() < x.max() < 120
    assert 0 < y.min() < y.max() < 90
    step = -(-samples // len(points))
    shown = episode.pull[::step], episode.bend[::step]
    assert (x.argmax(), y.argmin()) == (shown[0].argmax(), shown[1].argmax())


def test_an_endoscope_at_rest_is_drawn_too():
    still = dataclasses.replace(make_episode(), pull=np.zeros(12), bend=np.zeros(12))
    assert "nan" not in still._repr_html_()


@pytest.mark.parametrize(
    ("module", "call", "extra"),
    [
        ("pandas", lambda: make_episode().to_dataframe(), "notebook"),
        ("pandas", lambda: twin.Dataset([make_episode()]).to_dataframe(), "notebook"),
        ("matplotlib", lambda: make_episode().plot(), "viz"),
    ],
)
def test_without_its_extra_one_line_says_what_to_install(monkeypatch, module, call, extra):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "twin.report.figures", raising=False)
    with pytest.raises(twin.EndoTwinError, match=rf"needs {module}: pip install 'endotwin\[{extra}\]'"):
        call()
