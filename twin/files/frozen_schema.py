"""Keys of `assets/frozen_test_set.json`, what the records of the frozen test set are told by."""

from pydantic import BaseModel, ConfigDict, Field

MOST_RECORDS = 1000


class FrozenFile(BaseModel):
    """The keys of `frozen_test_set.json`.

    Attributes:
        name: of the test set; another one has another name.
        preset: packaged preset that is randomised.
        seconds: length of each record [s].
        seed: of commands and twins.
        drives_sha256: of all that is simulated, as `twin.suite.frozen.drives_sha256` has it.
        times_s: times that angles are kept at [s].
        bends_deg: angle of each record at these times, in the order of the records [deg].
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: str = Field(min_length=1, max_length=60)
    preset: str
    seconds: float
    seed: int
    drives_sha256: str = Field(pattern="^[0-9a-f]{64}$")
    times_s: list[float] = Field(min_length=2, max_length=100)
    bends_deg: list[list[float]] = Field(min_length=1, max_length=MOST_RECORDS)
