"""Tally of an export: records read and written, and losses of damaged files."""

import dataclasses
from pathlib import Path
from typing import Any

from twin.episode import Episode
from twin.recording import Recovered


@dataclasses.dataclass
class Tally:
    """Counts of an export.

    Attributes:
        episodes: written.
        samples: in all episodes.
        seconds: in all episodes [s].
        recovered: of each damaged file: samples that were read, how many there once were, and what is wrong.
        lost: each file that nothing is left of, and why.
        pictures: records whose pictures are written.
        pictures_left_out: records whose pictures are not, as the format has none, or samples were thinned.
    """

    episodes: int = 0
    samples: int = 0
    seconds: float = 0.0
    recovered: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    lost: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    pictures: int = 0
    pictures_left_out: int = 0

    def count(self, episode: Episode) -> None:
        """Add an episode that is written."""
        self.episodes += 1
        self.samples += len(episode.time)
        self.seconds = round(self.seconds + len(episode.time) * episode.sample_time, 9)

    def count_recovered(self, file: Path, recovered: Recovered) -> None:
        """Add a damaged file that something is left of."""
        self.recovered.append(
            {
                "file": str(file),
                "samples": recovered.samples,
                "samples_expected": recovered.samples_expected,
                "faults": list(recovered.faults),
            }
        )

    @property
    def damage(self) -> str:
        """Pictures, and losses of damaged files, as the end of a sentence; empty for neither."""
        told = ""
        if self.pictures:
            told += f"; with the pictures of {self.pictures} as video"
        if self.pictures_left_out:
            told += f"; without the pictures of {self.pictures_left_out}, which parquet would hold as video"
        if self.recovered:
            got = sum(file["samples"] for file in self.recovered)
            expected = [file["samples_expected"] for file in self.recovered]
            if None in expected:
                missing = f"{got} samples are whole of an unknown number"
            else:
                gone = sum(expected) - got
                missing = (
                    f"{gone} of {sum(expected)} samples ({100 * gone / sum(expected):.1f} %) are missing"
                )
            told += f"; damaged files: {len(self.recovered)}, {missing}"
        if self.lost:
            told += f"; files of which nothing is left: {len(self.lost)}"
        return told
