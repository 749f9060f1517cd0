"""The report is one file that needs nothing else, and says what a run folder lacks."""

import json
import re
import shutil

import numpy as np
import pytest
from PIL import Image
from small_dataset import measured_log

from twin.episode import Episode
from twin.evaluation.paper import paper_value
from twin.evaluation.track import Track, save_tracks
from twin.measured.folder import write_measured
from twin.recording import write_episode
from twin.rendering.video import write_video
from twin.report import page as report
from twin.report.page import write_report

METHODS = ("C-H", "AM", "LSTM", "Direct RL", "RAM")


def make_rows() -> list[dict]:
    rows = []
    for noise, level in (
        ("gaussian", 1.0),
        ("gaussian", 5.0),
        ("poisson", 0.1),
        ("poisson", 1.0),
        ("poisson", 2.0),
    ):
        for rank, method in enumerate(METHODS):
            rmse = 5.0 - rank
            rows.append(
                {
                    "noise": noise,
                    "level": level,
                    "sample_time_s": 0.1,
                    "method": method,
                    "oracle": False,
                    "mae_deg": 0.8 * rmse,
                    "rmse_deg": rmse,
                    "md_deg": 0.7 * rmse,
                    "var_deg2": rmse,
                    "bias_deg": 0.1,
                    "rmse_steady_deg": rmse,
                    "rmse_ci95_deg": [0.99 * rmse, 1.01 * rmse],
                    "seeds": 20,
                    "paper_rmse_deg": paper_value(noise, level, method, "rmse_deg"),
                }
            )
    return rows


def make_episode() -> Episode:
    time = np.arange(100) * 0.1
    bend = 0.4 * np.sin(time)
    return Episode(
        time=time,
        pull=1e-3 * np.sin(time + 0.3),
        bend=bend,
        measured_bend=bend,
        joint_angle=np.repeat(bend[:, None] / 4, 4, axis=1),
        wire_tension=np.ones((100, 2, 2)),
        sheath_friction=np.ones((100, 2, 1)),
    )


@pytest.fixture
def run(tmp_path):
    """A run folder with everything that a report can show."""
    folder = tmp_path / "run"
    for name in ("data/train", "data/test", "runs/ram", "runs/direct", "results"):
        (folder / name).mkdir(parents=True)
    for name in ("train", "test"):
        write_episode(folder / "data" / name / "episode_000.mcap", make_episode())
    model = {"a_per_mm": 1.15, "b_deg_per_mm": 22.38, "c_deg_per_mm": 5.0, "monotone": False, "seed": 17}
    (folder / "coleman_hodgdon.json").write_text(json.dumps(model))
    for name in ("ram", "direct"):
        (folder / "runs" / name / "config.yaml").write_text("learning_rate: 0.00025\nhorizon: 1024\n")
        (folder / "runs" / name / "progress.csv").write_text("samples,mean_reward\n1024,-3.0\n2048,-1.5\n")
    (folder / "results/evaluation.json").write_text(
        json.dumps({"protocol": {"initial_error_deg": 15, "test_stroke_mm": [-1, 1]}, "rows": make_rows()})
    )
    time = np.arange(0, 10, 0.1)
    truth = 20 * np.sin(time)
    estimates = {method: truth + 0.5 for method in METHODS}
    save_tracks(folder / "results/tracks.npz", [Track("gaussian", 1.0, time, truth, truth, estimates)])
    Image.fromarray(np.full((20, 40, 3), 200, np.uint8)).save(folder / "bend.png")
    frames = [np.full((64, 128, 3), 30 * level, np.uint8) for level in range(8)]
    write_video(folder / "bend.mp4", frames, 10, 128, 64)
    return folder


def page_of(folder) -> str:
    return write_report(folder, folder / "report.html").read_text()


def test_the_report_is_one_file_that_loads_nothing_else(run):
    page = page_of(run)
    addresses = re.findall(r"""(?:src|href|xlink:href|action|data)\s*=\s*["']([^"']*)""", page)
    assert len(addresses) > 10
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert not re.search(r"<script|<link|@import|url\(\s*['\"]?http", page)
    for target in re.findall(r'href="#([^"]*)"', page):
        assert f'id="{target}"' in page
    assert [file.name for file in run.iterdir() if file.name.startswith(".")] == []


def test_a_whole_run_is_shown_without_gaps(run):
    page = page_of(run)
    assert 'class="gap"' not in page
    assert "RAM has a lower RMSE than every method tried under 5 of 5 noises." in page
    assert "data:video/mp4;base64," in page
    assert page.count("data:image/svg+xml;base64,") == 6  # RMSE, two loops, Figs. 5 and 6, training
    assert "As the paper's Fig. 5: Direct RL, RAM" in page.replace("&#39;", "'")
    assert "1.000" in page
    assert "paper 0.635" in page
    assert "0.22" in page  # c / b of a model that is not monotone
    for fact in ("learning rate", "0.00025", "initial error deg", "-1, 1", "17"):
        assert fact in page


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
    assert page.count('class="gap"') == (2 if missing == "results/evaluation.json" else 1)

    if missing != "bend.png":
        path.write_bytes(b"\x00damaged")
        if missing == "bend.mp4":
            return  # a browser's business: the film is passed on as it is
        assert f"{missing} cannot be shown: " in page_of(run)


def test_a_large_film_becomes_a_strip_of_frames(run, monkeypatch):
    monkeypatch.setattr(report, "LARGEST_VIDEO", 10)
    page = page_of(run)
    assert "data:video" not in page
    assert "Six moments of bend.mp4" in page


def test_text_of_a_run_cannot_become_markup(run):
    (run / "demo.json").write_text(json.dumps({"host": "<script>alert(1)</script>"}))
    assert "<script>" not in page_of(run)


def test_a_folder_without_a_run_is_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"holds no run: expected one of data/train") as error:
        write_report(tmp_path, tmp_path / "report.html")
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_report(tmp_path / "nowhere", tmp_path / "report.html")


def test_recipe_of_a_dataset_is_shown_with_its_strokes(run, tmp_path, whole_dataset):
    contents = json.loads((whole_dataset / "dataset.json").read_text())
    contents["recipe"]["strokes_mm"] = [[2.0, 4.0], [-1.0, 1.0]]
    (run / "data" / "train" / "dataset.json").write_text(json.dumps(contents))
    page = write_report(run, tmp_path / "report.html").read_text()
    assert "[2, 4], [-1, 1]" in page
    assert "sensor, variance deg2" in page


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
