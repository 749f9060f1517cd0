"""Progress of long work, as a bar on stderr."""

import contextlib
import math
import sys
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from tqdm import tqdm


IN_A_FILE_S = 10.0
"""Least time between two states of a bar that nobody watches: a log of hours stays short [s]."""


class Progress:
    """A bar on stderr that is told how far the work is: `Progress("training")(done, total, note)`."""

    _shown: ClassVar[list["tqdm[Any]"]] = []

    def __init__(self, what: str, unit: str = ""):
        self.bar: tqdm[Any] | None = None
        self.what = what
        self.unit = unit

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Show that `done` of `total` are done."""
        with contextlib.suppress(OSError, ValueError):  # nobody reads stderr: that is no reason to stop
            self._show(done, total, note)

    def _show(self, done: int, total: int, note: str) -> None:
        if self.bar is None:
            from tqdm import tqdm

            self.bar = tqdm(
                total=total,
                desc=self.what,
                unit=self.unit or "it",
                file=sys.stderr,
                unit_scale=True,
                mininterval=0.1 if sys.stderr.isatty() else IN_A_FILE_S,
            )
            self._shown.append(self.bar)
        if note:
            self.bar.set_postfix_str(note, refresh=False)
        self.bar.update(done - self.bar.n)
        if done >= total:
            self.bar.close()

    @classmethod
    def close_all(cls) -> None:
        """Leave every bar as it stands, each on a line of its own."""
        while cls._shown:
            with contextlib.suppress(OSError, ValueError):
                cls._shown.pop().close()


class TrainingProgress(Progress):
    """A bar that is told the mean reward too, and shows it as the error that it is."""

    def __call__(self, done: int, total: int, reward: float | str = "") -> None:
        """Show that `done` of `total` are done, at a mean reward per sample [deg^2]."""
        if isinstance(reward, str):
            note = reward
        else:  # nothing is known of it before the first validation
            note = "" if math.isnan(reward) else f"mean square error {-reward:.3f} deg^2"
        super().__call__(done, total, note)
