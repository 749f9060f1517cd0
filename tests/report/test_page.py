"""The page of a run is one file that needs nothing else, and says what the run lacks."""

import json
import re
import shutil

import pytest
from paged import CONDITIONS, make_calibration, make_gate, make_run
from small_dataset import measured_log

from twin.measured.folder import write_measured
from twin.report import run_page
from twin.report.page import known_file, write_report


@pytest.fixture
def run(tmp_path):
    """A run folder with everything that a report can show."""
    return make_run(tmp_path / "run", tracks=1)


def page_of(folder) -> str:
    return write_report(folder, folder / "report.html").read_text()


def test_a_whole_run_is_shown_without_gaps_and_with_every_figure_of_the_paper(tmp_path):
    page = page_of(make_run(tmp_path / "run")).replace("&#39;", "'")
    assert 'class="gap"' not in page
    assert "RAM estimates the bending angle to 1.00 deg (RMSE over 5 noises), 50 % less error than" in page
    assert "data:video/mp4;base64," in page
    for number in range(1, 11):
        assert page.count(f"As the paper's Fig. {number}: ") == 2, number  # its text and its alternative
    assert "(0.635)" in page
    assert "= 0.22</span>" in page  # c / b of a model that is not monotone
    for fact in ("learning rate", "0.00025", "initial error deg", "-1, 1", "17"):
        assert fact in page
    assert len(CONDITIONS) == len(re.findall(r"Table II.*?, (?:R|λ) = ", page)) / 2  # title and label


@pytest.mark.parametrize(
    ("missing", "verb"),
    [
        ("data/train", "generate"),
        ("data/test", "generate"),
        ("coleman_hodgdon.json", "identify"),
        ("runs", "train"),
        ("results/evaluation.json", "evaluate"),
        ("results/tracks.npz", "evaluate"),
        ("bend.png", "render"),
        ("bend.mp4", "render"),
    ],
)
def test_what_is_missing_or_damaged_is_said_with_its_command(run, missing, verb):
    path = run / missing
    path.rename(run / "elsewhere")
    page = page_of(run)
    assert f"This run has no {missing}. This makes it: <code>endotwin {verb} " in page
    assert page.count('class="gap"') == (2 if missing == "coleman_hodgdon.json" else 1)

    if missing != "bend.png":
        path.write_bytes(b"\x00damaged")
        if missing == "bend.mp4":
            return  # a browser's business: the film is passed on as it is
        assert f"{missing} cannot be shown: " in page_of(run)


def test_a_large_film_becomes_a_strip_of_frames(run, monkeypatch):
    monkeypatch.setattr(run_page, "LARGEST_VIDEO", 10)
    page = page_of(run)
    assert "data:video" not in page
    assert "Six moments of bend.mp4" in page


def test_text_of_a_run_cannot_become_markup(run):
    (run / "demo.json").write_text(json.dumps({"host": "<script>alert(1)</script>"}))
    assert "<script>alert" not in page_of(run)


def test_a_folder_without_a_run_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"holds no run: expected one of data/train.*NAME_fit.json") as error:
        write_report(tmp_path, tmp_path / "report.html")
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_report(tmp_path / "nowhere", tmp_path / "report.html")


def test_recipe_of_a_dataset_is_shown_with_its_strokes_and_its_hash(run, tmp_path, whole_dataset):
    contents = json.loads((whole_dataset / "dataset.json").read_text())
    contents["recipe"]["strokes_mm"] = [[2.0, 4.0], [-1.0, 1.0]]
    (run / "data" / "train" / "dataset.json").write_text(json.dumps(contents))
    page = write_report(run, tmp_path / "report.html").read_text()
    assert "[2, 4], [-1, 1]" in page
    assert "sensor, variance deg2" in page
    assert "SHA-256 of dataset.json" in page


def test_dataset_json_of_an_older_version_is_said_in_one_line(run, tmp_path):
    (run / "data" / "train" / "dataset.json").write_text(json.dumps({"recipe": {"seeds": [17]}, "files": []}))
    page = write_report(run, tmp_path / "report.html").read_text()
    assert "cannot be shown: source is missing" in page


def test_measured_dataset_is_shown_by_what_it_holds(run, tmp_path):
    (tmp_path / "measured").mkdir()
    write_measured(tmp_path / "measured", "log", measured_log(tmp_path))
    shutil.copy(tmp_path / "measured" / "dataset.json", run / "data" / "train")
    page = write_report(run, tmp_path / "report.html").read_text()
    assert "<dt>source</dt><dd>measured</dd>" in page


def test_a_calibration_is_known_by_its_preset_too_and_two_must_be_told_apart(tmp_path):
    folder = make_calibration(tmp_path)
    assert known_file(folder / "rig.yaml") == known_file(folder) == (folder / "rig_fit.json", "_fit.json")
    page = write_report(folder / "rig.yaml", tmp_path / "r.html").read_text()
    assert "One twin follows the log that it was fitted to to 0.25 deg" in page
    assert "within 0.75 deg, against 2.50 (Coleman-Hodgdon)." in page
    shutil.copy(folder / "rig_fit.json", folder / "other_fit.json")
    with pytest.raises(ValueError, match=r"holds 2 calibrations \(other_fit.json, rig_fit.json\): name one"):
        known_file(folder)


@pytest.mark.parametrize(
    "damage", [{"checks": []}, {"verdict": "perhaps"}, {"subject": {}}, {"checks": [{}]}]
)
def test_a_damaged_gate_json_is_one_line(tmp_path, damage):
    path = make_gate(tmp_path) / "gate.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | damage))
    with pytest.raises(ValueError, match=r"gate.json is not what `endotwin gate` wrote: "):
        write_report(tmp_path, tmp_path / "report.html")
