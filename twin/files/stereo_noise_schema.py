"""Keys of `assets/stereo_noise.json`, the measured errors of stereo sensors."""

from pydantic import BaseModel, ConfigDict, Field


class StereoNoiseFile(BaseModel):
    """The keys of `stereo_noise.json`.

    Attributes:
        bends_deg: grid of angles [deg].
        errors_deg: errors of each rig, at each angle of the grid, several times [deg].
        hides_per_pass: share of passes of an instrument that hide a marker.
        hidden_s: times for which they did [s].
    """

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    bends_deg: list[float] = Field(min_length=2)
    errors_deg: list[list[list[float]]] = Field(min_length=1)
    hides_per_pass: float = Field(ge=0, le=2)
    hidden_s: list[float] = Field(min_length=1)
