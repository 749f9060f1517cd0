"""`endotwin export`: what the files of each format say, and mistakes in one line."""

import csv
import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from exporting import make_records, run
from recorded import assert_equal, make_episode
from repository import REPOSITORY, endotwin

import twin.export.export
from twin.measured.folder import write_measured
from twin.measured.log import read_measured_log
from twin.recording import read_episode, write_episode

pq = pytest.importorskip("pyarrow.parquet")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return make_records(tmp_path / "data")


def test_summary_and_parquet_agree_with_the_records(data, tmp_path, capsys):
    code, out, err = run(capsys, data, "--out", tmp_path / "le", "--json")
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert (summary["episodes"], summary["samples"], summary["format"]) == (3, 63, "parquet")
    assert summary["seconds"] == pytest.approx(63 * 0.02)
    assert summary["bytes"] == sum(path.stat().st_size for path in (tmp_path / "le").rglob("*.*"))
    table = pq.read_table(tmp_path / "le" / "data")
    wanted = [read_episode(data / f"episode_{k:04}.mcap") for k in range(3)]
    bend = np.concatenate([np.degrees(episode.bend) for episode in wanted])
    np.testing.assert_array_equal(table["truth.bend_deg"].to_numpy(), bend)
    code, out, _ = run(capsys, data, "--out", tmp_path / "again")
    assert out.startswith(f"{tmp_path / 'again'}: 3 episodes, 1.26 s, as parquet (")
    files = sorted(path.relative_to(tmp_path / "le") for path in (tmp_path / "le").rglob("*.*"))
    assert all((tmp_path / "le" / f).read_bytes() == (tmp_path / "again" / f).read_bytes() for f in files)


def test_csv_reads_back_as_the_same_doubles_and_all_of_it_if_wanted(data, tmp_path, capsys):
    assert run(capsys, data, "--out", tmp_path / "main", "--format", "csv")[0] == 0
    assert run(capsys, data, "--out", tmp_path / "all", "--format", "csv", "--columns", "all")[0] == 0
    names = [f"episode_{k:04}.csv" for k in range(3)]
    assert sorted(path.name for path in (tmp_path / "all").iterdir()) == names
    episode = read_episode(data / "episode_0001.mcap")
    main, *rows = csv.reader((tmp_path / "main" / "episode_0001.csv").open())
    header, *rows = csv.reader((tmp_path / "all" / "episode_0001.csv").open())
    table = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    assert main == ["time_s", "pull_mm", "bend_deg", "tension_a_n", "tension_b_n"] == header[:5]
    for name, wanted in {
        "time_s": episode.time,
        "pull_mm": episode.pull * 1e3,
        "measured_deg": np.degrees(episode.measured_bend),
        "pulley_mm": episode.pulley * 1e3,
        "sheath_bend_deg": np.degrees(episode.sheath_bend),
        "wire_tension_b_2_n": episode.wire_tension[:, 1, 2],
        "wire_slack_a_2_mm": episode.wire_slack[:, 0, 2] * 1e3,
        "sheath_friction_a_1_n": episode.sheath_friction[:, 0, 1],
        "joint_angle_2_rad": episode.joint_angle[:, 2],
    }.items():
        np.testing.assert_array_equal(table[name], wanted)
    assert len(header) == len(set(header)) == 5 + 3 + 2 * (3 + 2 + 3) + 3


def test_whole_mcap_files_stay_as_they_are_and_thinned_ones_are_rewritten(data, tmp_path, capsys):
    assert run(capsys, data, "--out", tmp_path / "same", "--format", "mcap")[0] == 0
    for path in data.iterdir():
        assert (tmp_path / "same" / path.name).read_bytes() == path.read_bytes()
    words = (data, "--out", tmp_path / "thin", "--format", "mcap", "--sample-time", "0.1")
    assert run(capsys, *words)[0] == 0
    thin = read_episode(tmp_path / "thin" / "episode_0000.mcap")
    assert_equal(thin, read_episode(data / "episode_0000.mcap").resampled(0.1))


def test_files_of_one_name_get_those_of_their_folders(data, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    write_episode(other / "episode_0000.mcap", make_episode(seed=5, drive=True))
    assert run(capsys, data, other, "--out", tmp_path / "m", "--format", "mcap")[0] == 0
    names = sorted(path.stem for path in (tmp_path / "m").iterdir())
    assert names == [*(f"data_episode_000{k}" for k in range(3)), "other_episode_0000"]
    assert run(capsys, data, other, "--out", tmp_path / "p")[0] == 0
    rows = pq.read_table(tmp_path / "p" / "meta" / "episodes").to_pylist()
    assert [row["source"] for row in rows] == names


def test_an_uneven_log_becomes_frames_on_a_grid_with_nan_where_nothing_was_measured(tmp_path, capsys):
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.015, 0.025, 400))
    angle = 40 * np.sin(time)
    lines = [
        f"{t},{30 * np.sin(t)},{'' if 100 <= k < 120 else a}"
        for k, (t, a) in enumerate(zip(time, angle, strict=True))
    ]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,command_deg,angle_deg", *lines]) + "\n")
    (tmp_path / "measured").mkdir()
    write_measured(tmp_path / "measured", "log", read_measured_log(tmp_path / "log.csv"))
    code, _, err = run(capsys, tmp_path / "measured", "--out", tmp_path / "le")
    assert code == 2
    assert "must be evenly apart" in err
    assert "such as 0.02 s" in err
    words = (tmp_path / "measured", "--out", tmp_path / "le", "--sample-time", "0.02")
    assert run(capsys, *words)[0] == 0
    table = pq.read_table(tmp_path / "le" / "data")
    seen = table["observation.state"].to_numpy()
    lost = np.isnan(seen)
    grid = np.arange(len(seen)) * 0.02
    assert grid[lost].min() > time[99] - time[0]
    assert grid[lost].max() < time[120] - time[0]
    np.testing.assert_allclose(seen[~lost], 40 * np.sin(time[0] + grid[~lost]), atol=0.01)
    stats = json.loads((tmp_path / "le" / "meta" / "stats.json").read_text())["observation.state"]
    assert stats["count"] == [int((~lost).sum())]
    assert stats["mean"] == [pytest.approx(np.nanmean(seen.astype(float)), rel=1e-9)]
    assert pq.read_table(tmp_path / "le" / "meta" / "tasks.parquet")["task"].to_pylist() == [
        "bend the endoscope as in the measured log"
    ]


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("--out le", "no data given"),
        ("empty --out le", "no *.mcap file in empty"),
        ("data data/episode_0001.mcap --out le", "data/episode_0001.mcap is given twice"),
        ("data --out data", "the folder data is not empty: choose another name, or remove it"),
        ("data --out data/episode_0000.mcap", "is there and is no folder"),
        ("data --out data/episode_0000.mcap/le", "cannot write to the folder"),
        ("data --out le --sample-time 0.01", "must be at least the record's 0.02 s"),
        ("data --out le --columns all", "--columns all is for --format csv"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(data, tmp_path, capsys, monkeypatch, words, fault):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    code, out, err = run(capsys, *words.split())
    assert (code, out) == (2, "")
    assert fault in err
    assert len(err.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "empty"]


def test_without_pyarrow_one_line_names_what_to_install_before_any_work(data, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)  # what Python holds of a module that is not there
    code, _, err = run(capsys, data, "--out", tmp_path / "le")
    assert (code, err) == (
        2,
        "endotwin export: the format parquet needs pyarrow: pip install 'endotwin[parquet]'",
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]
    assert run(capsys, data, "--out", tmp_path / "csv", "--format", "csv")[0] == 0
    imported = "import twin.export.export, sys; print([name for name in sys.modules if 'pyarrow' in name])"
    done = subprocess.run([sys.executable, "-c", imported], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_a_disk_that_fills_up_leaves_nothing_and_one_line(tmp_path, form):
    write_episode(tmp_path / "long.mcap", make_episode(3000, vertebrae=16, elements=10))

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    words = ["export", "long.mcap", "--out", "le", "--format", form]
    done = endotwin(*words, cwd=tmp_path, preexec_fn=little_room)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == f"endotwin export: {tmp_path / 'le'}: File too large"
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["long.mcap"]


def test_a_stopped_export_leaves_nothing(data, tmp_path, capsys, monkeypatch):
    def stop(path: Path, episode: object, everything: bool) -> None:
        Path(path).write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr(twin.export.export, "write_csv", stop)
    code, _, err = run(capsys, data, "--out", tmp_path / "le", "--format", "csv")
    assert (code, err) == (130, "endotwin export: stopped")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]
