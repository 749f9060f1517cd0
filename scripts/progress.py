"""Progress of long work, as a bar on stderr."""

import contextlib
import math
import sys
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from tqdm import tqdm

LOGGED_EVERY = 10.0  # seconds between two lines of a bar in a file


class Progress:
    """A bar on stderr: `Progress("training")(done, total, note)` shows that `done` of `total` are done."""

    _shown: ClassVar[list["tqdm[Any]"]] = []

    def __init__(self, what: str, unit: str = "it"):
        self.bar: tqdm[Any] | None = None
        self.what = what
        self.unit = unit

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Show that `done` of `total` are done; a closed stderr is no reason to stop."""
        with contextlib.suppress(OSError, ValueError):
            if self.bar is None:
                from tqdm import tqdm

                self.bar = tqdm(
                    total=total,
                    desc=self.what,
                    unit=self.unit,
                    file=sys.stderr,
                    unit_scale=True,
                    mininterval=0.1 if sys.stderr.isatty() else LOGGED_EVERY,
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
    """A bar that shows the mean reward per sample [deg^2] as the error that it is."""

    def __call__(self, done: int, total: int, reward: float | str = "") -> None:
        """Show that `done` of `total` are done; the reward is NaN before the first validation."""
        if not isinstance(reward, str):
            reward = "" if math.isnan(reward) else f"mean square error {-reward:.3f} deg^2"
        super().__call__(done, total, reward)
