"""A browser and the pages of every kind of run, made once for all tests of the pages."""

import pytest
from browser import open_browser
from paged import EVERY_KIND, make_pages


@pytest.fixture(scope="session")
def browser():
    with open_browser() as opened:
        yield opened


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """The page of every kind of run, by kind."""
    made = make_pages(tmp_path_factory.mktemp("pages"))
    assert made.keys() == set(EVERY_KIND)
    return made
