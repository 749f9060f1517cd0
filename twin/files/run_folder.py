"""Run folder: belongs to one configuration, stated in its `config.yaml`."""

from pathlib import Path
from typing import Any

import yaml

from twin.errors import InputError
from twin.files.atomic import write_whole


def claim_folder(folder: Path, configuration: dict[str, Any]) -> None:
    """Write `config.yaml` into a run folder, or check that the run already there has this configuration.

    Raises:
        ValueError: it has another one.
    """
    path = folder / "config.yaml"
    text = yaml.safe_dump(configuration, sort_keys=False)
    if path.is_file():
        if path.read_text() != text:
            raise InputError(
                f"{folder} holds a run of another configuration: choose another `folder` or remove it"
            )
        return
    write_whole(path, text)
