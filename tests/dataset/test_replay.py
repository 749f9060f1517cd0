"""Replaying proves that a file is what its recipe makes, and says where it is not."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from recorded import make_episode as random_episode
from small_dataset import RECIPE, SECOND, SMALL, make, measured_log

from twin import __version__
from twin.dataset.episodes import make_episode
from twin.dataset.recipe import EpisodeKey
from twin.dataset.recipe_file import resolve
from twin.dataset.verify import replay
from twin.episode import Episode
from twin.files.bounded import sha256_of
from twin.measured.folder import write_measured
from twin.recording import write_episode


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    make(folder)
    return folder


def test_replay_makes_the_same_bytes(whole, tmp_path):
    for number in range(3):
        result = replay(whole / f"episode_000{number}.mcap")
        assert result.same
        assert result.differs == []
        assert result.sha256 == sha256_of(whole / f"episode_000{number}.mcap")
        assert result.line == f"the same bytes again, 50 samples, 1 s (SHA-256 {result.sha256})"
    pull = (1e-3 * np.sin(np.arange(30) / 7)).tolist()
    values = {"preset": SMALL.to_dict(), "given_pull_m": pull, "seeds": [3, 9], "episodes": 2}
    make(tmp_path, resolve(values, tmp_path))
    assert replay(tmp_path / "seed_9_episode_0001.mcap").same
    moved = shutil.copy(whole / SECOND, tmp_path / "renamed.mcap")
    assert replay(Path(moved)).same


def made(**changes: Any) -> Episode:
    """The second episode, with some of it changed."""
    episode = make_episode(RECIPE, EpisodeKey(11, 1))
    return dataclasses.replace(episode, **changes)


def raised(values: np.ndarray, sample: int, by: float) -> np.ndarray:
    changed_values = values.copy()
    changed_values[sample] += by
    return changed_values


def test_file_with_other_numbers_and_whole_crcs_is_found_to_differ_and_where(tmp_path):
    episode = made()
    tension = episode.wire_tension.copy()
    tension[31, 1, 2] += 0.25
    path = write_episode(
        tmp_path / "a.mcap", made(bend=raised(episode.bend, 17, np.radians(0.5)), wire_tension=tension)
    )
    result = replay(path)
    assert not result.same
    assert result.differs == ["truth_deg by up to 0.5 from sample 17 on", "wire_tension_n by up to 0.25 from "
                              "sample 31 on"]  # fmt: skip
    assert result.line == "differs in " + "; ".join(result.differs)


def test_last_digit_of_one_number_is_found_to_differ(tmp_path):
    pull = made().pull.copy()
    pull[49] = np.nextafter(pull[49], 1)
    result = replay(write_episode(tmp_path / "a.mcap", made(pull=pull)))
    assert not result.same
    assert [line.split(" by ")[0] for line in result.differs] == ["pull_mm"]
    assert result.differs[0].endswith("from sample 49 on")


def test_measurements_that_are_missing_and_times_that_are_moved_are_found_to_differ(tmp_path):
    measured = made().measured_bend.copy()
    measured[5:7] = np.nan
    result = replay(write_episode(tmp_path / "a.mcap", made(measured_bend=measured)))
    assert result.differs == ["measured_deg by missing numbers from sample 5 on"]
    result = replay(write_episode(tmp_path / "c.mcap", made().resampled(0.04)))
    assert "truth_deg (not the same shape)" in result.differs
    result = replay(write_episode(tmp_path / "b.mcap", made(time=made().time + 0.5)))
    assert result.differs == ["time_s by up to 0.5 from sample 0 on"]


def test_versions_that_differ_are_named(tmp_path):
    facts = made().metadata | {"mujoco": "2.0.1", "endotwin": "0.0.1"}
    result = replay(write_episode(tmp_path / "a.mcap", made(metadata=facts)))
    assert not result.same
    assert result.differs == []
    assert result.line == (
        f"the numbers are the same, the bytes are not. endotwin 0.0.1 made it, here is {__version__}. "
        f"mujoco 2.0.1 made it, here is {mujoco.__version__}"
    )


def test_file_that_carries_no_recipe_is_refused(tmp_path):
    log = write_measured(tmp_path, "log", measured_log(tmp_path))
    other = write_episode(tmp_path / "other.mcap", random_episode())
    for path in (log, other):
        with pytest.raises(ValueError, match=f"{path.name} carries no recipe: only what `endotwin generate`"):
            replay(path)


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        (b"preset: [", "the recipe that it carries cannot be read: not a YAML file"),
        (b"\xff", "the recipe that it carries cannot be read"),
        (b"command_csv: /dev/zero", "the recipe that it carries cannot be read: it names files"),
        (b"colour: red", "the recipe that it carries cannot be read: unknown key colour"),
        (b"preset: nothing.yaml", "the recipe that it carries cannot be read: it names files"),
        (b"preset: {name: a}\nseconds: 1", "the recipe that it carries is of another version of EndoTwin"),
    ],
)
def test_recipe_that_cannot_be_followed_is_said_in_one_line(tmp_path, recipe, message):
    attachments = made().attachments | {"recipe.yaml": recipe}
    path = write_episode(tmp_path / "a.mcap", made(attachments=attachments))
    with pytest.raises(ValueError, match=message) as refused:
        replay(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)
