"""Live path: JSON lines or a log through a trained estimator, watched and backed by a trusted filter.

A sample goes from `lines` through `checks` and the estimator (`online`), the pair with its fallback and
`monitor` (`assured`), to the answer and to sinks: a recording, a viewer. `log_run` streams episodes. Needed
are NumPy, SciPy and ONNX Runtime; neither MuJoCo nor torch.
"""

from twin.live.assured import AssuredEstimator, load_runtime, prepare_runtime
from twin.live.reading import Alarm, Health, Reading, Sink, Source, StreamSample

__all__ = [
    "Alarm",
    "AssuredEstimator",
    "Health",
    "Reading",
    "Sink",
    "Source",
    "StreamSample",
    "load_runtime",
    "prepare_runtime",
]
