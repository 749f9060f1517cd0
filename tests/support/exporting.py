"""Records to export, and `endotwin export` as a user types it."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from recorded import make_episode

from scripts import export as verb
from twin.episode import Episode
from twin.recording import write_episode


def make_records(folder: Path) -> Path:
    """A folder of three records, of 20, 21 and 22 samples."""
    folder.mkdir()
    for k in range(3):
        write_episode(folder / f"episode_{k:04}.mcap", make_episode(20 + k, seed=k, drive=True))
    return folder


def run(capsys: pytest.CaptureFixture, *words: object) -> tuple[int, str, str]:
    """Exit code, stdout, and what stderr prints next to the bar of progress, slow or fast."""
    code = verb.main([str(word) for word in words])
    printed = capsys.readouterr()
    lines = [
        line
        for line in printed.err.replace("\r", "\n").splitlines()
        if line.strip() and not line.rstrip().endswith(("ep/s]", "s/ep]"))
    ]
    return code, printed.out, "\n".join(lines)


def make_full(samples: int, seed: int, **facts: object) -> Episode:
    """Everything that can be recorded, in two planes, with a missing measurement."""
    episode = make_episode(samples, seed=seed, planes=2, drive=True, start=0.5)
    measured = episode.measured_bend.copy()
    measured[1] = np.nan
    slack = np.random.default_rng(seed).normal(size=episode.wire_tension.shape) * 1e-4
    metadata = episode.metadata | facts
    return dataclasses.replace(episode, measured_bend=measured, wire_slack=slack, metadata=metadata)
