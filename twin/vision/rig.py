"""Rig of two cameras: their parameters, and their place in front of the bending section."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from twin.errors import InputError
from twin.files.shown import shown, suggestion

METHODS = ("markers", "silhouette")
"""Methods of measurement: markers on tip and shaft, or the centre line of the silhouette."""


@dataclasses.dataclass(frozen=True)
class StereoRig:
    """Two cameras that look at the bending plane from the front, a little from the left and from the right.

    Distances are in lengths of the bending section, so that a rig fits every endoscope.
    """

    method: str = "markers"  # one of `METHODS`
    frames_per_second: float = 10.0  # pairs of pictures per second, at most one a sample [1 / s]
    width: int = 640  # of a picture [pixels]
    height: int = 480  # of a picture [pixels]
    distance: float = 6.0  # from the cameras to the middle of what they see [section lengths]
    angle_deg: float = 40.0  # between the axes of the two cameras [deg]
    half_height: float = 0.88  # half the height that is seen in the bending plane [section lengths]
    marker_size: float = 0.2  # side of a marker [section lengths]
    blur_px: float = 0.7  # standard deviation of the lenses' blur [pixels]
    exposure_s: float = 0.008  # time for which a row is exposed [s]
    brightness: float = 1.0  # factor on the light; 1 leaves white below saturation
    pixel_noise: float = 3.0  # standard deviation of the noise of a pixel at mid-grey, of 255 levels
    # time between the first and the last row of a picture [s]; 0: a global shutter
    rolling_shutter_s: float = 0.0
    occlusions_per_minute: float = 0.0  # how often an instrument passes before the cameras [1 / min]
    distortion: float = 1.0  # scale of the lenses' radial distortion: k1 is about -0.1 times it
    calibration_views: int = 24  # pictures of the board that the cameras are calibrated with
    pictures_per_second: float = 1.0  # pairs that are recorded [1 / s]; 0: none
    seed: int = 0  # of mounting tolerances and of the calibration's pictures: another one is another rig

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"stereo method {self.method!r}: must be one of {', '.join(METHODS)}")
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"stereo {name} = {value}: must be from {low:g} to {high:g}")


def stereo_rig(parameters: Mapping[str, Any]) -> StereoRig:
    """Return a rig with some parameters changed; refuses names, types and values that are not valid."""
    usual = StereoRig()
    fields = [field.name for field in dataclasses.fields(usual)]
    values: dict[str, Any] = {}
    for name, value in parameters.items():
        if name not in fields:
            raise InputError(f"stereo: unknown parameter {shown(name)}{suggestion(name, fields)}")
        kind: type = type(getattr(usual, name))
        if isinstance(value, bool) or isinstance(value, str) != (kind is str):
            wanted = "a name" if kind is str else "a number"
            raise InputError(f"stereo {name} = {shown(value)}: must be {wanted}")
        if kind is int and value != int(value):
            raise InputError(f"stereo {name} = {shown(value)}: must be a whole number")
        values[name] = kind(value)
    return StereoRig(**values)


def parse_rig(words: Sequence[str]) -> dict[str, Any]:
    """Parse words such as `blur_px=1.5` into parameters of a rig by name."""
    parsed: dict[str, Any] = {}
    for word in words:
        name, sign, text = word.partition("=")
        if not sign or not text:
            raise InputError(f"stereo {shown(word)}: must be NAME=VALUE, as in blur_px=1.5")
        try:
            parsed[name] = float(text)
        except ValueError:
            parsed[name] = text
    return parsed


LIMITS: dict[str, tuple[float, float]] = {
    "frames_per_second": (0.1, 1000.0),
    "width": (160, 2560),
    "height": (120, 2560),
    "distance": (2.0, 50.0),
    "angle_deg": (5.0, 120.0),
    "half_height": (0.5, 5.0),
    "marker_size": (0.05, 0.5),
    "blur_px": (0.0, 10.0),
    "exposure_s": (0.0, 1.0),
    "brightness": (0.05, 10.0),
    "pixel_noise": (0.0, 60.0),
    "rolling_shutter_s": (0.0, 1.0),
    "occlusions_per_minute": (0.0, 60.0),
    "distortion": (-3.0, 3.0),
    "calibration_views": (6, 200),
    "pictures_per_second": (0.0, 1000.0),
    "seed": (0, 2**63 - 1),
}
"""Lowest and highest value of each number of a rig."""
