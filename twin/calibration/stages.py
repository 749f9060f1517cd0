"""Stages of a calibration: told when they are done, kept in a file, and not done again."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.files.state_file import damaged_state, read_state, write_state

Array = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")
OnProgress = Callable[[int, int, float], None]
"""Called with the stages done, their total, and the lowest cost so far."""

STATE = "calibration state"
"""Kind of the state that an interrupted calibration leaves."""


class Stages:
    """Stages of one calibration."""

    def __init__(self, total: int, state_file: Path | None, key: str, on_progress: OnProgress | None) -> None:
        """Take up what an interrupted calibration with the same key left.

        Args:
            total: number of stages.
            state_file: where what is found is kept.
            key: SHA-256 of all that the calibration depends on.
            on_progress: told of each stage.

        Raises:
            ValueError: the state file is foreign or damaged.
        """
        self._kept = (read_state(state_file, STATE, key) if state_file else None) or {}
        self._state_file, self._key, self._on_progress = state_file, key, on_progress
        self._total, self._done = total, 0
        self._lowest, self._lock = np.inf, threading.Lock()

    def tell(self, cost: float) -> None:
        """Tell that a stage is done."""
        self._done += 1
        self._lowest = min(self._lowest, cost)
        if self._on_progress:
            self._on_progress(self._done, self._total, self._lowest)

    def skip(self, stages: int, cost: float) -> None:
        """Tell of stages that there is no need of."""
        for _ in range(stages):
            self.tell(cost)

    def once(self, name: str, shape: tuple[int, ...], work: Callable[[], Array]) -> Array:
        """Return the result of a stage: as it was kept, or worked out and kept."""
        found = self._kept.get(name)
        if found is not None:
            if self._state_file and found.shape != shape:
                raise damaged_state(self._state_file)
            return found
        found = work()
        with self._lock:
            self._kept[name] = found
            if self._state_file is not None:
                write_state(self._state_file, STATE, self._key, self._kept)
        return found

    def side_by_side(
        self, work: Callable[[T, threading.Event], R], items: Sequence[T], cost_of: Callable[[R], float]
    ) -> list[R]:
        """Return the work on each item, in threads of their own; each that is done is told."""
        stopped = threading.Event()
        with ThreadPoolExecutor() as pool:
            waiting = [pool.submit(work, item, stopped) for item in items]
            try:
                done = []
                for one in waiting:
                    done.append(one.result())
                    self.tell(cost_of(done[-1]))
                return done
            except BaseException:
                stopped.set()
                pool.shutdown(cancel_futures=True)
                raise
