from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from rl.supervised import SequenceTraining


@pytest.fixture(scope="module")
def few_steps() -> Iterator[None]:
    """Networks are trained by few steps: what they have learned is asserted elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        _, *others = SequenceTraining.__init__.__defaults__
        patch.setattr(SequenceTraining.__init__, "__defaults__", (20, *others))
        yield


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes are made in this process: that workers make the same is asserted elsewhere."""
    monkeypatch.setattr("twin.workers.processes.local_workers", ThreadPoolExecutor)
