"""A trained graph bound to arrays of its own, for one stream: a run copies nothing and allocates nothing."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.learned.trained_file import TrainedFile

Array32 = NDArray[np.float32]


class BoundNetwork:
    """A graph with one input and one output, on one sample at a time.

    Attributes:
        given: (1, n) what the graph takes: write into it.
        returned: (1, m) what it returns: read from it after `run`.
    """

    def __init__(self, file: TrainedFile, inputs: int, outputs: int):
        """Bind the graph of a file that takes (B, inputs) and returns (B, outputs)."""
        self.given: Array32 = np.zeros((1, inputs), np.float32)
        self.returned: Array32 = np.zeros((1, outputs), np.float32)
        (taken,), (told,) = file.session.get_inputs(), file.session.get_outputs()
        self._binding: Any = file.session.io_binding()
        self._binding.bind_input(taken.name, "cpu", 0, np.float32, (1, inputs), self.given.ctypes.data)
        self._binding.bind_output(told.name, "cpu", 0, np.float32, (1, outputs), self.returned.ctypes.data)
        self._session = file.session

    def run(self) -> None:
        """Run the graph on what was given."""
        self._session.run_with_iobinding(self._binding)
