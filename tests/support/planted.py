"""A pickle that makes a file when something loads it."""

import io
import pickle
import zipfile
from pathlib import Path


class Planted:
    """Makes a file when it is unpickled."""

    def __init__(self, witness: Path) -> None:
        self.witness = witness

    def __reduce__(self):
        return Path.touch, (self.witness,)


def planted_pickle(witness: Path) -> bytes:
    return pickle.dumps(Planted(witness))


def planted_zip(witness: Path) -> bytes:
    """As torch and stable-baselines3 save: an archive of pickles."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in ("data", "policy.pth", "archive/data.pkl", "weights.npy"):
            archive.writestr(name, planted_pickle(witness))
    return buffer.getvalue()
