"""The dataset that processes and clusters make again."""

from pathlib import Path

import pytest
from workers_recipe import RECIPE

from twin.dataset.write import write_dataset
from twin.workers.processes import local_workers


@pytest.fixture(scope="session")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local") / "data"
    with local_workers(1) as executor:
        write_dataset(RECIPE, folder, executor, workers=1)
    return folder
