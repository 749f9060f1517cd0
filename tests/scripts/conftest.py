from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import briefly
import pytest


@pytest.fixture(scope="module")
def few_steps() -> Iterator[None]:
    """Networks and filters take few steps: what they have learned is asserted elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.train_networks(patch)
        briefly.tune_filters(patch)
        yield


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes are made in this process: that workers make the same is asserted elsewhere."""
    monkeypatch.setattr("scripts.generate.local_workers", ThreadPoolExecutor)
