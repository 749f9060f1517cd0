import os
import shutil
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # tests run side by side: one thread each

import briefly
import numpy as np
import pytest
import quick_export
import small_policy
import untaught_policy
from hypothesis import settings
from models import COLEMAN_HODGDON
from small_dataset import make
from small_disks import small_disk

from twin.hysteresis import ColemanHodgdon

__all__ = ["small_disk"]

# The same examples every time, whatever the machine; `--hypothesis-profile=thorough` draws ten times as many.
settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("thorough", deadline=None, max_examples=500)
settings.load_profile("repeatable")

SAMPLE_TIME = 0.1
LONGEST = (
    "test_hostile_files.py",
    "test_hostile_arguments.py",
    "test_full_suite.py",
    "test_verbs.py",
    "test_training.py",
    "test_interrupted.py",
)
"""Files that begin first, so that no worker waits long for another's last one."""


@pytest.fixture(scope="session", autouse=True)
def quick_exporter() -> Iterator[None]:
    """Trained files are exported by tracing, in a second where torch's own exporter takes ten."""
    with pytest.MonkeyPatch.context() as patch:
        quick_export.take(patch)
        yield


@pytest.fixture(scope="module")
def in_one_process() -> Iterator[None]:
    """Work of local workers is done in this process, for all tests of a file."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.work_in_place(patch)
        yield


@pytest.fixture(scope="module")
def own_exporter() -> Iterator[None]:
    """Trained files are exported as the product does it."""
    with pytest.MonkeyPatch.context() as patch:
        quick_export.leave(patch)
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
def whole_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small dataset with tables, which no test changes."""
    folder = tmp_path_factory.mktemp("whole")
    make(folder, csv=True)
    return folder


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture(scope="session")
def ram_policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's RAM, hardly trained: one file for all processes of a run of the tests."""
    return small_policy.shared(_of_all(tmp_path_factory) / "policy")


@pytest.fixture(scope="session")
def twins_policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """RAM (twins) that nothing was taught to: one file for all processes of a run of the tests."""
    return untaught_policy.shared(_of_all(tmp_path_factory) / "twins_policy")


def _of_all(factory: pytest.TempPathFactory) -> Path:
    """Return the folder of all processes of a run."""
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture
def dataset_copy(whole_dataset: Path, tmp_path: Path) -> Path:
    """A copy of it, to be damaged or changed."""
    return Path(shutil.copytree(whole_dataset, tmp_path / "data"))
