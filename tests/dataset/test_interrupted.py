"""Generation killed at random moments, and several at once: the same bytes in the end, no damaged file.

`make endurance` kills a hundred times.
"""

import collections
import contextlib
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
from small_dataset import make

from twin.dataset.recipe_file import load_recipe
from twin.dataset.verify import verify
from twin.recording import read_episode

EPISODES = 24
RECIPE = f"""
preset: {{name: small, vertebrae: 6, sheath_elements: 2, section_stiffness: 0.05, pretension: 3.0}}
episodes: {EPISODES}
seconds: 4
strokes_mm: [[-1, 1], [0, 2]]
"""
ORPHANS_END_SECONDS = 10


class Run:
    """One run of the command, in a session of its own."""

    def __init__(self, folder: Path, workers: int = 2) -> None:
        self.folder = folder
        (folder.parent / "recipe.yaml").write_text(RECIPE)
        words = ["generate", "recipe.yaml", "--out", folder, "--workers", str(workers), "--format", "csv"]
        self.process = subprocess.Popen(
            command(*words),
            cwd=folder.parent,
            env=ENVIRONMENT,
            stdout=subprocess.DEVNULL,
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

    def wait_for_new_file(self) -> None:
        before = set(self.folder.glob("*.mcap"))
        while self.process.poll() is None and not set(self.folder.glob("*.mcap")) - before:
            time.sleep(0.01)

    def finish(self) -> tuple[int, str]:
        """Wait for its end: exit code and stderr."""
        _, printed = self.process.communicate(timeout=120)
        assert "Traceback" not in printed
        return self.process.returncode, printed


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed") / "data"
    (folder.parent / "recipe.yaml").write_text(RECIPE)
    make(folder, load_recipe(folder.parent / "recipe.yaml"), csv=True)
    return folder


def assert_nothing_damaged(folder: Path, undisturbed: Path) -> None:
    """Every file with a final name is that of the undisturbed run."""
    for path in folder.glob("[!.]*"):
        same = filecmp.cmp(path, undisturbed / path.name, shallow=False)
        if not same and path.suffix == ".mcap":
            read_episode(path)  # names the fault
        assert same, f"{path.name} differs from the undisturbed run's"


@pytest.mark.parametrize("kills", [2, pytest.param(100, marks=pytest.mark.endurance)])
def test_kills_leave_whole_files_and_the_same_dataset_in_the_end(kills, undisturbed, tmp_path):
    rng = np.random.default_rng(0)
    folder = tmp_path / "data"
    hit: collections.Counter[str] = collections.Counter()
    for kill in itertools.takewhile(lambda _: hit.total() < kills, itertools.count()):
        run = Run(folder)
        begins = hit.total() % 3 == 2
        if begins:  # it writes its recipe, checks the folder
            time.sleep(rng.uniform(0, 3))
        else:  # it writes episodes
            run.wait_for_new_file()
            time.sleep(rng.exponential(0.05))
        family = run.family()
        parent, workers = family[:1], [one for one in family[1:] if "spawn_main" in " ".join(one.cmdline())]
        # In turn, so that both are hit; one that has ended already is not, and the next run is.
        victims = family if begins else parent if hit.total() % 2 else workers
        if victims:
            victim = victims[int(rng.integers(len(victims)))]
            with contextlib.suppress(ProcessLookupError):
                os.kill(victim.pid, signal.SIGKILL)
                hit["parent" if victim in parent else "child"] += 1
        code, printed = run.finish()
        _, alive = psutil.wait_procs(family, timeout=ORPHANS_END_SECONDS)
        assert not alive, f"orphans of kill {kill}: {alive}"
        if code not in (0, -signal.SIGKILL):
            assert code == 2
            line = printed.splitlines()[-1]
            if "a worker was killed, perhaps for want of memory" in line:
                assert f"of {EPISODES} episodes are complete; the same command continues" in line
        if folder.exists():
            assert_nothing_damaged(folder, undisturbed)
            if (folder / "dataset.json").exists():
                shutil.rmtree(folder)
    code, printed = Run(folder).finish()
    assert code == 0, printed
    assert sorted(os.listdir(folder)) == sorted(os.listdir(undisturbed))
    assert_nothing_damaged(folder, undisturbed)
    assert min(hit["parent"], hit["child"]) > 0


@pytest.mark.slow
def test_several_generates_at_once_make_one_dataset(tmp_path):
    runs = [Run(tmp_path / "data", workers=1) for _ in range(3)]
    ends = [run.finish() for run in runs]
    assert {code for code, _ in ends} <= {0, 2}
    assert all(code == 0 or "another run is writing into" in text.splitlines()[-1] for code, text in ends)
    assert 0 in {code for code, _ in ends}
    assert verify(tmp_path / "data") == ([], EPISODES)
