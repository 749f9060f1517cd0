"""The page of every kind of result: it holds the numbers of its files, and names what they lack."""

import json
import re
import shutil

import pytest
from paged import (
    CONDITIONS,
    EVERY_KIND,
    METHODS,
    control_results,
    control_total,
    make_calibration,
    make_evaluation,
    make_pages,
    make_run,
)

from twin.report.report import known_file, write_report
from twin.report.run_page import run_commands

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def made_run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("made") / "run")


@pytest.fixture
def run(made_run, tmp_path):
    """A run folder with everything that a report can show."""
    return shutil.copytree(made_run, tmp_path / "run")


def page_of(path) -> str:
    return write_report(path, path / "report.html").read_text()


def rows_of(page: str) -> list[list[str]]:
    """Texts of the cells of every row of every table."""
    return [re.findall(r">([^<]+)<", row) for row in re.findall(r"<tr>(.*?)</tr>", page, re.DOTALL)]


def test_every_kind_has_captions_alternatives_and_versions(tmp_path):
    for kind, path in make_pages(tmp_path).items():
        page = path.read_text()
        assert "endotwin " in page.partition('id="how-to-repeat-it"')[2], kind
        assert len(re.findall(r"<figcaption>[^<]+\.</figcaption>", page)) == page.count("<figure") >= 1
        assert len(re.findall(r"<img alt=\"[^\"]{20,}", page)) == page.count("<img ")
        if kind not in ("run", "training"):  # the fixtures of these have no origin
            assert "<dt>endotwin</dt>" in page
    assert len(EVERY_KIND) == 7


def test_a_whole_run_is_shown_without_gaps_and_with_every_figure_of_the_paper(run):
    page = page_of(run).replace("&#39;", "'")
    assert 'class="gap"' not in page
    assert "data:video/mp4;base64," in page
    for number in range(1, 11):
        assert page.count(f"As the paper's Fig. {number}: ") == 2, number  # its text and its alternative
    assert "(0.635)" in page
    for fact in ("below 1/2", "learning rate", "0.00025", "initial error deg", "-1, 1", "17"):
        assert fact in page
    assert len(CONDITIONS) == len(re.findall(r"Table II.*?, (?:R|λ) = ", page)) / 2  # title and label


def test_methods_are_ranked_by_the_geometric_mean_over_noises(run):
    rows = [row for row in rows_of(page_of(run)) if row[0] in METHODS]
    ranked = rows[len(METHODS) : 2 * len(METHODS)]  # after the table of the first screen
    assert [row[0] for row in ranked] == ["RAM", "Direct RL", "LSTM", "AM", "C-H"]
    assert [row[-5:-3] for row in ranked] == [[f"{k}", f"{k}.000"] for k in range(1, 6)]


def test_a_page_begins_with_the_best_method_that_can_be_deployed(tmp_path):
    """An oracle with a third of the error is last, labelled, and neither bold nor in the sentence."""
    path = make_evaluation(tmp_path / "results") / "evaluation.json"
    contents = json.loads(path.read_text())
    oracles = [
        of | {"method": "RAM (oracle)", "oracle": True, "rmse_deg": 0.33, "is_best": False}
        for of in contents["rows"][4::5]
    ]
    path.write_text(json.dumps(contents | {"rows": contents["rows"] + oracles}))
    front = page_of(path.parent).partition("<nav")[0]
    (sentence,) = re.findall(r'<p class="headline">(.*?)</p>', front)
    assert sentence.startswith("RAM has the least error of the methods that can be deployed: 1.00 deg")
    assert "Direct RL, has 2.00" in sentence
    rows = rows_of(front)[1:]
    assert [row[0] for row in rows] == ["RAM", "Direct RL", "LSTM", "AM", "C-H", "RAM (oracle)"]
    assert rows[-1] == ["RAM (oracle)", "sees the true angle", *["0.33"] * 5]
    assert re.findall(r'class="best">([^<]*)<', front) == ["1.00"] * 5


def test_ranks_with_intervals_are_those_of_the_evaluation(tmp_path):
    path = make_evaluation(tmp_path / "results") / "evaluation.json"
    ranked = {"method": "AM", "rmse_deg": 0.5, "rmse_ci95_deg": [0.4, 0.6], "rank": 1, "rank_ci95": [1, 2]}
    other = {"method": "RAM", "rmse_deg": 0.7, "rmse_ci95_deg": None, "rank": None, "rank_ci95": None}
    place = {"sample_time_s": 0.1, "stroke_mm": [], "twin": ""}
    ranks = [
        place | {"ranked": [other | {"to_best_ci95": [1.1, 1.5]}, ranked | {"to_best_ci95": [1.0, 1.0]}]}
    ]
    path.write_text(json.dumps(json.loads(path.read_text()) | {"ranks": ranks}))
    place = 2 + len(METHODS)  # after the table of the first screen
    first, second = rows_of(page_of(path.parent))[place : place + 2]
    assert first[-7:] == ["1", "1 to 2", "0.500", "0.400 to 0.600", "1.00 to 1.00", "-", "1"]
    assert second[-5:] == ["-", "0.700", "1.10 to 1.50", "-", "1"]


def test_what_is_missing_or_damaged_is_named_with_its_command(run):
    verbs = {name: command.split()[0] for name, command in run_commands().items()}
    for name in verbs:
        (run / name).rename(run / ("old_" + name.replace("/", "_")))
    (run / "demo.json").write_text("{}")
    page = page_of(run)
    for name, verb in verbs.items():
        assert f"This run has no {name}. This makes it: <code>endotwin {verb} " in page
        (run / name).write_bytes(b"\x00damaged")
    assert page.count('class="gap"') == len(verbs) + 1  # and no file that states how it was made
    page = page_of(run)
    for name in verbs:
        assert f"{name} cannot be shown: " in page


def test_a_folder_without_a_result_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"holds no run: expected one of data/train.*NAME_fit.json") as error:
        write_report(tmp_path, tmp_path / "report.html")
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_report(tmp_path / "nowhere", tmp_path / "report.html")


def test_a_calibration_is_known_by_its_preset_too_and_one_of_two_must_be_named(tmp_path):
    folder = make_calibration(tmp_path)
    assert known_file(folder / "rig.yaml") == known_file(folder) == (folder / "rig_fit.json", "_fit.json")
    rows = rows_of(write_report(folder / "rig.yaml", tmp_path / "r.html").read_text())
    assert ["log 0", "0", "fitted", "0.25", "1.50"] in rows
    assert ["log 1", "-", "predicted", "0.75", "2.50"] in rows
    assert ["log 0", "4.0 %", "-"] in rows
    assert ["pretension", "4.4", "not determined"] in rows
    page = (tmp_path / "r.html").read_text().partition("<nav")[0]
    assert (
        "The twin follows the logs within 0.25 deg and predicts what was not fitted within 0.75 deg" in page
    )
    assert f"endotwin gate runs/device/policy.onnx data/measured --preset {folder / 'rig.yaml'}" in page
    assert "The logs do not determine all parameters" in page
    assert "is nearer to the logs" not in page  # the twin is: 0.25 deg, Coleman-Hodgdon 1.50
    shutil.copy(folder / "rig_fit.json", folder / "other_fit.json")
    with pytest.raises(ValueError, match=r"holds 2 calibrations \(other_fit.json, rig_fit.json\): name one"):
        known_file(folder)


def test_controllers_are_ranked_with_what_is_better_than_each(tmp_path):
    less = {"condition": "R = 1", "controller": "ours", "rival": "pid", "reduction": 0.75}
    less |= {"reduction_ci95": [0.7, 0.8]}
    given = control_results(
        control_total("pid", 1.0),
        control_total("ours", 0.25, fallback_share=0.125),
        control_total("oracle", 0.1, oracle=True),
        control_total("pid", 1.5, "bends"),
        comparisons=(less, less | {"condition": "bends", "rival": "other", "reduction": 0.1}),
    )
    (tmp_path / "control.json").write_text(json.dumps(given))
    page = write_report(tmp_path, tmp_path / "control.html").read_text()
    ranked = rows_of(page)[1:4]
    assert [row[0] for row in ranked] == ["ours", "pid", "oracle"]
    assert "ours follows best: 0.25 deg (RMSE), where the next, pid, has 1.00." in page
    assert ranked[1] == ["pid", "1.00", "2.00", "75 %", "70 to 80 %"]
    assert ["R = 1", "11", "11", "fallback 12.5 %", "11"] in rows_of(page)
    assert ["bends", "150.0", "-", "-"] in rows_of(page)  # percent of the uncompensated error
    for stated in ("0.123", "1.2.3", "a &amp; b", f"endotwin control --controller pid ours --out {tmp_path}"):
        assert stated in page


@pytest.mark.parametrize("damage", [{"totals": []}, {"control": {}}, {"tuned": [{"x": 1}]}, {"totals": 3}])
def test_a_damaged_control_json_is_one_line(tmp_path, damage):
    (tmp_path / "control.json").write_text(json.dumps(control_results(control_total("a", 1.0)) | damage))
    with pytest.raises(ValueError, match=r"control.json is not what `endotwin control` wrote: "):
        write_report(tmp_path, tmp_path / "report.html")
