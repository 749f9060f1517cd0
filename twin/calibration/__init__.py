"""Calibration of a preset on measured logs: free parameters, fit, uncertainty, report."""

from twin.calibration.logs import MeasuredLoop, measured_loop
from twin.calibration.parameters import FreeParameters, free_parameters, structures, with_slack
from twin.calibration.search import Fit, calibrate
from twin.calibration.uncertainty import Uncertainty, likely_ranges, uncertainty

__all__ = [
    "Fit",
    "FreeParameters",
    "MeasuredLoop",
    "Uncertainty",
    "calibrate",
    "free_parameters",
    "likely_ranges",
    "measured_loop",
    "structures",
    "uncertainty",
    "with_slack",
]
