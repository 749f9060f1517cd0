"""Origin of a result: the command that makes it again, its versions, the hash of its data."""

import contextlib
import hashlib
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin import __version__
from twin.files.bounded import sha256_of
from twin.files.dataset_json import NAME

PACKAGES = ("mujoco", "numpy", "scipy", "onnxruntime")  # whose versions a result may depend on
Line = Annotated[str, Field(max_length=4000)]


class DataHash(BaseModel):
    """Hash of what a result was made from, as the command names it; see `data_sha256`."""

    model_config = ConfigDict(frozen=True, strict=True)

    path: Line
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class Origin(BaseModel):
    """Origin of a result, as its JSON file states it: the command without the place of its output."""

    model_config = ConfigDict(frozen=True, strict=True)

    command: Line
    versions: Annotated[dict[str, Line], Field(max_length=50)]
    data: Annotated[list[DataHash], Field(max_length=10_000)]


def origin_of(command: str, data: Sequence[Path]) -> dict[str, Any]:
    """Return the origin of a result that is made now by a command from files and folders, as plain values."""
    versions = {"endotwin": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            versions[name] = version(name)
    hashes = [{"path": str(path), "sha256": data_sha256(path)} for path in data]
    return {"command": command, "versions": versions, "data": hashes}


def data_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, of a dataset's `dataset.json`, or of the names and hashes in a folder."""
    if not path.is_dir():
        return sha256_of(path)
    if (path / NAME).is_file():
        return sha256_of(path / NAME)
    lines = [f"{sha256_of(file)}  {file.name}\n" for file in sorted(path.glob("*.mcap"))]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def stated_origin(values: Mapping[str, Any]) -> Origin | None:
    """Return the origin that the contents of a JSON file state; None where it is missing or incomplete."""
    try:
        return Origin.model_validate(values["origin"])
    except (KeyError, ValidationError):
        return None
