from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import briefly
import pytest


@pytest.fixture(scope="module")
def few_steps() -> Iterator[None]:
    """Filters are tuned by few steps: what they have learned is asserted elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.tune_filters(patch)
        yield


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes are made in this process: that workers make the same is asserted elsewhere."""
    monkeypatch.setattr("twin.workers.processes.local_workers", ThreadPoolExecutor)
