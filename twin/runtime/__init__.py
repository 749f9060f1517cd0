"""The runtime: a trained estimator beside a trusted fallback, watched, sample by sample.

It needs NumPy and ONNX Runtime; neither MuJoCo nor torch. It knows no transport: lines of text are in
`twin.stream`, recordings in `twin.recording`, the viewer in `scripts`.
"""

from twin.runtime.assured import AssuredEstimator
from twin.runtime.load import load_runtime, prepare_runtime
from twin.runtime.reading import Alarm, Reading, Source

__all__ = ["Alarm", "AssuredEstimator", "Reading", "Source", "load_runtime", "prepare_runtime"]
