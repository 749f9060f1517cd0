"""OpenCV, the one door to it: its own annotations tell arrays of every kind, where ours are of floats."""

from typing import Any

import cv2 as _cv2

cv2: Any = _cv2
_cv2.setNumThreads(1)  # a worker has one core
