import os
from collections.abc import Iterator
from pathlib import Path

import briefly
import built_workbench
import pytest
from hostile_runs import Runner


@pytest.fixture(scope="module")
def few_steps() -> Iterator[None]:
    """Filters are tuned by few steps: what they have learned is asserted elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.tune_filters(patch)
        yield


@pytest.fixture(scope="session")
def runner(worker_count: int) -> Iterator[Runner]:
    """Warm processes that fork for each run of a command."""
    with Runner(worker_count) as runner:
        yield runner


@pytest.fixture(scope="session")
def worker_count() -> int:
    """As many as there are cores; one where tests run side by side."""
    return 1 if "PYTEST_XDIST_WORKER" in os.environ else os.cpu_count() or 1


@pytest.fixture(scope="session")
def workbench(tmp_path_factory: pytest.TempPathFactory, runner: Runner) -> built_workbench.Workbench:
    """Good input for every verb, built once for all processes of a run of the tests.

    HOSTILE_WORKBENCH names a folder that keeps it from run to run.
    """
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    return built_workbench.shared(Path(os.environ.get("HOSTILE_WORKBENCH", shared / "workbench")), runner)


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work of local workers is done in this process, for one test."""
    briefly.work_in_place(monkeypatch)
