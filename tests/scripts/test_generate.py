"""`endotwin generate`: a recipe's file and the flags that change it, verifying, replaying, a cluster."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from scripts.generate import main
from twin.dataset.verify import RULES
from twin.recording import read_episode

RECIPE = """
preset: {name: small, vertebrae: 6, sheath_elements: 2, section_stiffness: 0.05, pretension: 3.0}
episodes: 2
seconds: 1
signals: [sine, triangle]
seeds: [7]
"""

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path, monkeypatch, capfd, in_one_process) -> Run:
    """Run the command in a folder with a recipe; exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "recipe.yaml").write_text(RECIPE)

    def typed(line: str) -> tuple[int, str, str]:
        code = main(line.split())
        out, err = capfd.readouterr()
        return code, out, err

    return typed


def recipe_of(folder: str) -> dict:
    return yaml.safe_load((Path(folder) / "recipe.yaml").read_text())


def test_recipe_is_made_and_its_own_copy_makes_the_same_again(run):
    code, out, _ = run("recipe.yaml --out data --workers 1")
    assert (code, out) == (0, "data: 2 episodes, 2 s of small\n")
    assert run("data/recipe.yaml --out again --workers 1")[0] == 0
    for path in Path("data").iterdir():
        assert path.read_bytes() == (Path("again") / path.name).read_bytes()


def test_flags_override_the_recipe(run):
    flags = "--stroke -1 1 --seconds 0.5 --signal sine --episodes 1 --seed 3 --sensor-variance 2"
    assert run(f"recipe.yaml --out data --workers 1 --set pretension=4 {flags} --sheath-bend-deg 90")[0] == 0
    made = recipe_of("data")
    assert made["strokes_mm"] == [[-1, 1]]
    assert (made["seconds"], made["episodes"], made["signals"], made["seeds"]) == (0.5, 1, ["sine"], [3])
    assert made["sensor"] == {"variance_deg2": 2}
    assert made["sheath_bends_deg"] == [[90, 90]]
    assert (made["preset"]["pretension"], made["preset"]["vertebrae"]) == (4, 6)


def test_paths_in_a_recipe_are_relative_to_it_and_those_of_flags_to_here(run, tmp_path):
    (tmp_path / "deep").mkdir()
    preset = yaml.safe_load(RECIPE)["preset"]
    (tmp_path / "deep" / "mine.yaml").write_text(yaml.safe_dump(preset | {"name": "deep"}))
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(preset | {"name": "here"}))
    (tmp_path / "deep" / "r.yaml").write_text("preset: mine.yaml\nseconds: 1\nepisodes: 1\n")
    assert run("deep/r.yaml --out a --workers 1")[0] == 0
    assert run("deep/r.yaml --preset mine.yaml --out b --workers 1")[0] == 0
    assert recipe_of("a")["preset"]["name"] == "deep"
    assert recipe_of("b")["preset"]["name"] == "here"


def test_what_is_there_is_kept_and_what_is_damaged_is_made_again(run):
    run("recipe.yaml --out data --workers 1")
    whole = {path.name: path.read_bytes() for path in Path("data").iterdir()}
    damaged = bytearray(whole["episode_0001.mcap"])
    damaged[len(damaged) // 2] ^= 1
    Path("data/episode_0001.mcap").write_bytes(damaged)
    code, out, err = run("recipe.yaml --out data --workers 1 --json")
    assert code == 0
    assert json.loads(out)["kept"] == 1
    assert "made again: " in err
    assert "episode_0001.mcap is damaged" in err
    assert {path.name: path.read_bytes() for path in Path("data").iterdir()} == whole


def test_verify_says_what_is_wrong_and_its_exit_code_is_1(run):
    run("recipe.yaml --out data --workers 1")
    code, out, _ = run("--verify --out data")
    assert code == 0
    *rules, last = out.splitlines()
    assert last.startswith("data: all 2 episodes are complete")
    assert [line.split()[:2] for line in rules] == [["holds", rule] for rule in RULES]
    os.remove("data/episode_0000.mcap")
    code, out, err = run("--verify --out data --json")
    assert code == 1
    assert json.loads(out)["faults"] == ["data/episode_0000.mcap is missing"]
    assert "files: data/episode_0000.mcap is missing" in err
    assert json.loads(out)["rules"] == {"files": 1}
    shutil.rmtree("data")
    assert run("--verify --out data")[0] == 2


def test_replay_proves_a_run_bit_for_bit(run):
    run("recipe.yaml --out data --workers 1")
    code, out, _ = run("--replay data/episode_0001.mcap --json")
    assert code == 0
    assert json.loads(out)["same"] is True
    assert run("--replay data/nothing.mcap")[0] == 2
    assert run("--replay data/recipe.yaml")[0] == 2


def test_a_log_of_other_columns_drives_both_planes(run, tmp_path):
    rows = "\n".join(f"{50 * n},{n % 9 - 4},{0.05 * n},{n}" for n in range(21))
    (tmp_path / "log.csv").write_text("clock,knob_deg,side,angle_deg\n" + rows)
    columns = "--command-column knob_deg --lateral-command-column side --time-column clock --time-unit ms"
    bare = "recipe.yaml --workers 1 --set bending_planes=2 --episodes 1"
    line = f"{bare} --command-csv log.csv {columns}"
    (tmp_path / "recipe.yaml").write_text(RECIPE.replace("seconds: 1\nsignals: [sine, triangle]\n", ""))
    code, _, err = run(f"{line} --out data")
    assert code == 2
    assert err.endswith(
        "log.csv: column side does not end in its unit: give --command-unit, mm, m, deg or rad\n"
    )
    (tmp_path / "log.csv").write_text("clock,knob_deg,side_mm,angle_deg\n" + rows)
    assert run(f"{line} --out data".replace("side ", "side_mm "))[0] == 0
    episode = read_episode("data/episode_0000.mcap")
    degrees = episode.pull / episode.metadata["preset"]["pulley_radius"]
    assert (len(episode.time), 1e3 * episode.lateral_pull[25]) == (50, pytest.approx(0.5))
    assert np.degrees([degrees.min(), degrees.max()]) == pytest.approx([-4, 4], abs=0.9)
    assert "a given command sideways" in Path("data/README.md").read_text()
    assert run("--verify --out data")[0] == 0
    assert run("--replay data/episode_0000.mcap")[0] == 0


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("nothing.yaml --out x", "no recipe nothing.yaml"),
        ("recipe.yaml", "--out: name the folder"),
        ("--preset ureteroscope --signal sinus --out x", "unknown signal 'sinus'; valid: all, sine"),
        ("--command-column x --out x", "--command-column is about --command-csv: name its file"),
        ("recipe.yaml --time-unit ms --out x", "command_csv.file is missing"),
        ("recipe.yaml --workers -1 --out x", "--workers -1: must not be negative"),
        ("recipe.yaml --randomize --out x", "a preset given by its parameters states no ranges"),
        ("recipe.yaml --dask tcp --out x", "--dask 'tcp': must be as in tcp://192.168.0.7:8786"),
        ("recipe.yaml --verify --replay x --out x", "--replay and --verify: choose one"),
        ("recipe.yaml --pictures-per-second 0 --out x", "camera: 0 pictures per second: must be positive"),
    ],
)
def test_mistake_is_one_line_and_nothing_is_written(run, tmp_path, line, fault):
    before = sorted(os.listdir(tmp_path))
    code, out, err = run(line)
    assert (code, out) == (2, "")
    assert fault in err
    assert len(err.splitlines()) == 1
    assert sorted(os.listdir(tmp_path)) == before or os.listdir(tmp_path / "x") == []
