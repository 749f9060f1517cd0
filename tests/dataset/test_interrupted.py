"""Generation killed at random moments: no damaged file under a final name, and the same bytes in the end.

`make endurance` kills a hundred times.
"""

import collections
import contextlib
import dataclasses
import filecmp
import itertools
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from repository import ENVIRONMENT, command

from twin.recording import read_episode

EPISODES = 48
RECIPE = f"""
preset: {{name: small, vertebrae: 6, sheath_elements: 2, section_stiffness: 0.05, pretension: 3.0}}
episodes: {EPISODES}
seconds: 4
strokes_mm: [[-1, 1], [0, 2]]
"""
ORPHANS_END_SECONDS = 10


@dataclasses.dataclass
class Run:
    """One run of the command, in a session of its own."""

    folder: Path

    def __post_init__(self) -> None:
        words = ["generate", "recipe.yaml", "--out", self.folder, "--workers", "2", "--format", "csv"]
        self.process = subprocess.Popen(
            command(*words),
            cwd=self.folder.parent,
            env=ENVIRONMENT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            text=True,
        )

    def family(self) -> list[psutil.Process]:
        """The command and all that it has started."""
        try:
            parent = psutil.Process(self.process.pid)
            return [parent, *parent.children(recursive=True)]
        except psutil.NoSuchProcess:
            return []

    def finish(self) -> tuple[int, str]:
        """Wait for its end: exit code and what it said."""
        _, said = self.process.communicate(timeout=120)
        return self.process.returncode, said


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed") / "data"
    (folder.parent / "recipe.yaml").write_text(RECIPE)
    code, said = Run(folder).finish()
    assert code == 0, said
    assert len(list(folder.glob("*.mcap"))) == EPISODES
    return folder


def assert_nothing_damaged(folder: Path, undisturbed: Path) -> None:
    """Whatever has a final name is what the undisturbed run has under it."""
    for path in folder.glob("[!.]*"):
        same = filecmp.cmp(path, undisturbed / path.name, shallow=False)
        if not same and path.suffix == ".mcap":
            read_episode(path)  # says what is wrong
        assert same, f"{path.name} differs from the undisturbed run's"


def assert_same_folder(folder: Path, undisturbed: Path) -> None:
    assert sorted(os.listdir(folder)) == sorted(os.listdir(undisturbed))
    assert_nothing_damaged(folder, undisturbed)


@pytest.mark.parametrize("kills", [3, pytest.param(100, marks=pytest.mark.endurance)])
def test_kills_leave_whole_files_and_the_same_dataset_in_the_end(kills, undisturbed, tmp_path):
    rng = np.random.default_rng(0)
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    folder = tmp_path / "data"
    hit: collections.Counter[str] = collections.Counter()
    for kill in itertools.takewhile(lambda _: hit.total() < kills, itertools.count()):
        run = Run(folder)
        begins = hit.total() % 3 == 0
        if begins:  # writes its recipe, looks at what is there
            time.sleep(rng.uniform(0, 3))
        else:  # writes episodes
            wait_for_new_file(run, folder)
            time.sleep(rng.exponential(0.05))
        family = run.family()
        parent, children = family[:1], family[1:]
        # In turn, so that both are hit; one that has come to its end already is not, and the next run is.
        victims = family if begins else children if hit.total() % 2 else parent
        if victims:
            victim = victims[int(rng.integers(len(victims)))]
            with contextlib.suppress(ProcessLookupError):
                os.kill(victim.pid, signal.SIGKILL)
                hit["parent" if victim in parent else "child"] += 1
        code, said = run.finish()
        _, alive = psutil.wait_procs(family, timeout=ORPHANS_END_SECONDS)
        assert not alive, f"orphans of kill {kill}: {alive}"
        if code not in (0, -signal.SIGKILL):
            assert code == 2
            assert "Traceback" not in said
        if folder.exists():
            assert_nothing_damaged(folder, undisturbed)
            if (folder / "dataset.json").exists():
                shutil.rmtree(folder)
    code, said = Run(folder).finish()
    assert code == 0, said
    assert_same_folder(folder, undisturbed)
    print(f"killed: {dict(hit)}")
    assert min(hit["parent"], hit["child"]) > 0


def wait_for_new_file(run: Run, folder: Path) -> None:
    before = set(folder.glob("*.mcap"))
    while run.process.poll() is None and not set(folder.glob("*.mcap")) - before:
        time.sleep(0.01)


def test_killed_worker_is_told_in_one_line_with_what_to_do(undisturbed, tmp_path):
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    run = Run(tmp_path / "data")
    wait_for_new_file(run, tmp_path / "data")
    for process in run.family()[1:]:
        if "spawn_main" in " ".join(process.cmdline()):
            process.kill()
    code, said = run.finish()
    assert code == 2
    assert "a worker was killed, perhaps for want of memory" in said.splitlines()[-1]
    assert f"of {EPISODES} episodes are whole, the same command goes on from there" in said.splitlines()[-1]
