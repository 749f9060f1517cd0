"""The twins that a property of the physics is tested on."""

import pytest
from both_twins import TWINS, Twin


@pytest.fixture(scope="module", params=TWINS, ids=lambda twin: twin.name)
def twin(request) -> Twin:
    return request.param
