"""Checkpoint of a training: plain values and tensors in one file of torch, read without unpickling."""

import io
from pathlib import Path
from typing import Any

import torch

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited

LARGEST = 256 * MEBIBYTE
_MARK = "endotwin checkpoint"


def save_checkpoint(path: Path, key: str, state: dict[str, Any]) -> None:
    """Write tensors, numbers, texts, and lists and dictionaries of them, for the run of a key."""
    buffer = io.BytesIO()
    torch.save({_MARK: key, "state": state}, buffer)
    write_whole(path, buffer.getvalue())


def load_checkpoint(path: Path, key: str) -> dict[str, Any] | None:
    """Return the state of a checkpoint; None if there is none, or one of another run.

    Raises:
        ValueError: the file is no checkpoint, or it is damaged; it stays as it is.
    """
    if not path.exists():
        return None
    try:
        saved = torch.load(io.BytesIO(read_limited(path, LARGEST)), weights_only=True)
        found, state = saved[_MARK], saved["state"]
    except Exception as error:  # zipfile's, pickle's and torch's own classes
        raise unusable(path) from error
    return dict(state) if found == key else None


def unusable(path: Path) -> InputError:
    """Return the error for a file that is no checkpoint, or whose contents do not fit the training."""
    return InputError(f"{path} is no checkpoint of this training, or damaged: remove it to start again")
