"""The dataset that processes and clusters make again."""

from pathlib import Path

import pytest
from small_dataset import make
from workers_recipe import RECIPE


@pytest.fixture(scope="session")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local") / "data"
    make(folder, RECIPE)
    return folder
