"""Sequences that RAM (twins) learns from: stretches of the training records under noise drawn anew."""

import dataclasses
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from rl.supervised import tensor32
from rl.twins.noises import draw_noises
from rl.twins.records import SAMPLE_TIME, TwinRecords

STRIDES = (5, 2, 1)  # T of 0.1, 0.04 and 0.02 s
SHARES = (0.7, 0.15, 0.15)
FROM_THE_START = 0.5  # share of sequences that begin where the record begins


class Sequences(NamedTuple):
    """B sequences of N samples of one sample time, time first.

    Attributes:
        members_deg: (N, B, M) angle of the members [deg].
        way_mm: (N, B) that the tendon has gone since the sample before [mm].
        measurement_deg: (N, B) [deg].
        truth_deg: (N, B) [deg].
        variance: (B,) R [deg^2].
        bias_deg: (B,) mean of the noise [deg].
        gaussian: (B,) 1 where the noise is Gaussian, else 0.
        sample_time: (B,) T [s].
    """

    members_deg: torch.Tensor
    way_mm: torch.Tensor
    measurement_deg: torch.Tensor
    truth_deg: torch.Tensor
    variance: torch.Tensor
    bias_deg: torch.Tensor
    gaussian: torch.Tensor
    sample_time: torch.Tensor

    def between(self, begin: int, end: int) -> "Sequences":
        """Return the samples from one to another."""
        return self._replace(
            members_deg=self.members_deg[begin:end],
            way_mm=self.way_mm[begin:end],
            measurement_deg=self.measurement_deg[begin:end],
            truth_deg=self.truth_deg[begin:end],
        )


@dataclasses.dataclass(frozen=True)
class SequenceSource:
    """Source of sequences.

    Attributes:
        records: that stretches are taken from.
        noises: families of the noise.
    """

    records: TwinRecords
    noises: tuple[str, ...]

    def draw(
        self, count: int, samples: int, rng: np.random.Generator, stride: int | None = None
    ) -> Sequences:
        """Return sequences; their sample time is drawn, or `stride` times that of the records."""
        if stride is None:
            stride = int(rng.choice(STRIDES, p=SHARES))
        pull, members, truth = self.records
        last = pull.shape[1] - 1 - samples * stride
        command = rng.integers(len(pull), size=count)
        twin = rng.integers(truth.shape[1], size=count)
        start = np.where(rng.uniform(size=count) < FROM_THE_START, 0, rng.integers(last + 1, size=count))
        index = start + np.arange(samples + 1)[:, None] * stride  # (N + 1, B)
        followed = pull[command, index]
        angle = truth[command, twin, index[1:]]
        noise = draw_noises(self.noises, count, samples, rng)
        return Sequences(
            tensor32(members[command, :, index[1:]]),
            tensor32(np.abs(np.diff(followed, axis=0))),
            tensor32(angle + noise.noise_deg.T),
            tensor32(angle),
            tensor32(noise.variance),
            tensor32(noise.mean_deg),
            tensor32(noise.gaussian),
            torch.full((count,), stride * SAMPLE_TIME),
        )


def split_records(records: TwinRecords, held_out: int) -> tuple[TwinRecords, TwinRecords]:
    """Return the records of all commands but the last few, and of those: for validation."""
    return (
        TwinRecords(*(values[:-held_out] for values in records)),
        TwinRecords(*(values[-held_out:] for values in records)),
    )


def principal_directions(members_deg: NDArray[np.float32], rank: int) -> torch.Tensor:
    """Return the (M, r) directions among the members along which they differ most.

    Args:
        members_deg: (C, M, N) angle of the members [deg].
        rank: r.
    """
    thinned = members_deg[:, :, ::25].astype(float)
    anomaly = (thinned - thinned.mean(axis=1, keepdims=True)).transpose(1, 0, 2)
    rows = anomaly.reshape(len(anomaly), -1)
    left, _, _ = np.linalg.svd(rows @ rows.T)
    return tensor32(left[:, :rank])
