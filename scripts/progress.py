"""Progress of long work on stderr: a bar on a terminal, else a line from time to time."""

import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from tqdm import tqdm

LOGGED_EVERY = 10.0  # seconds between two lines where stderr is no terminal


class Progress:
    """Progress on stderr: `Progress("training")(done, total, note)` shows that `done` of `total` are done.

    A terminal has a bar. A file or a pipe has a line every `LOGGED_EVERY` seconds, short work none.
    """

    _shown: ClassVar[list["tqdm[Any]"]] = []

    def __init__(self, what: str, unit: str = "it"):
        self.bar: tqdm[Any] | None = None
        self.what = what
        self.unit = unit
        self._first: tuple[float, int] | None = None  # time and number done at the first call
        self._logged = 0.0  # time of the last line

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Show that `done` of `total` are done; a closed stderr is no reason to stop."""
        with contextlib.suppress(OSError, ValueError):
            if not sys.stderr.isatty():
                self._log(done, total, note)
                return
            if self.bar is None:
                from tqdm import tqdm

                self.bar = tqdm(total=total, desc=self.what, unit=self.unit, file=sys.stderr, unit_scale=True)
                self._shown.append(self.bar)
            if note:
                self.bar.set_postfix_str(note, refresh=False)
            self.bar.update(done - self.bar.n)
            if done >= total:
                self.bar.close()

    def _log(self, done: int, total: int, note: str) -> None:
        now = time.monotonic()
        if self._first is None:
            self._first, self._logged = (now, done), now
        if now - self._logged < LOGGED_EVERY or done >= total:
            return
        self._logged = now
        start, begun = self._first
        left = ""
        if done > begun:
            seconds = round((total - done) * (now - start) / (done - begun))
            left = f", {seconds // 60}:{seconds % 60:02} min left"
        print(f"{self.what}: {100 * done // total} %{left}{note and ', '}{note}", file=sys.stderr, flush=True)

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
