import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # tests run in parallel: one thread each

import briefly
import numpy as np
import pytest
from hypothesis import settings
from models import COLEMAN_HODGDON
from shared import made_once
from small_disks import small_disk

from twin.hysteresis import ColemanHodgdon

__all__ = ["small_disk"]

# The same examples every time, whatever the machine; `--hypothesis-profile=thorough` draws ten times as many.
settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=30)
settings.register_profile("thorough", deadline=None, max_examples=500)
settings.load_profile("repeatable")

SAMPLE_TIME = 0.1
LONGEST = (
    *("test_demo.py", "test_documents.py"),  # of `make validate`
    *("test_verbs.py", "test_training.py", "test_interrupted.py", "test_hostile.py"),
)
"""Files that begin first, so that no worker waits long for another's last one."""


@pytest.fixture(scope="session", autouse=True)
def quick_exporter() -> Iterator[None]:
    """Trained files are exported by tracing, in a second where torch's own exporter takes ten."""
    with pytest.MonkeyPatch.context() as patch:
        if "rl.export" in sys.modules:  # imported by a collected file; else a session needs no torch
            import quick_export

            quick_export.take(patch)
        yield


@pytest.fixture(scope="module")
def own_exporter() -> Iterator[None]:
    """Trained files are exported as the product does it."""
    import quick_export

    with pytest.MonkeyPatch.context() as patch:
        quick_export.leave(patch)
        yield


@pytest.fixture(scope="module")
def in_one_process() -> Iterator[None]:
    """Work of local workers is done in this process, for all tests of a file."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.work_in_place(patch)
        yield


@pytest.fixture(scope="session")
def model() -> ColemanHodgdon:
    """The paper's identified model, eq. 12."""
    return COLEMAN_HODGDON


@pytest.fixture(scope="session")
def records(model):
    """Three short records whose truth departs from the model by a slow disturbance: (pull_mm, bend_deg)."""
    time = np.arange(200) * SAMPLE_TIME
    made = []
    for period in (8.0, 10.0, 13.0):
        pull = 3 + np.sin(2 * np.pi * time / period)
        made.append((pull, model.response(pull, 60.0) + 2 * np.sin(2 * np.pi * time / 17)))
    return made


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small folder that holds good input for every verb, built once, which no test changes."""
    import workspace

    return made_once(tmp_path_factory, "workspace", workspace.build)[0]


@pytest.fixture(scope="session")
def summaries(workspace: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict]:
    """What each command printed that built the workspace, by its line."""
    return made_once(tmp_path_factory, "workspace", lambda _: {})[1]


@pytest.fixture(scope="session")
def whole_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small dataset with tables, which no test changes."""
    from small_dataset import make

    return made_once(tmp_path_factory, "whole", lambda folder: (make(folder, csv=True), None)[1])[0]


@pytest.fixture
def dataset_copy(whole_dataset: Path, tmp_path: Path) -> Path:
    """A copy of it, to be damaged or changed."""
    return Path(shutil.copytree(whole_dataset, tmp_path / "data"))


@pytest.fixture(scope="session")
def ram_policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's RAM, hardly trained."""
    import trained_files

    return made_once(tmp_path_factory, "policy", trained_files.train_ram)[0] / "policy.onnx"


@pytest.fixture(scope="session")
def twins_policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """RAM (twins) that was not trained."""
    import trained_files

    return made_once(tmp_path_factory, "twins_policy", trained_files.export_twins_policy)[0] / "policy.onnx"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.name, len(LONGEST)))
