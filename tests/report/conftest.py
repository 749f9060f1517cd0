"""The page of every kind of result, and a stand-in for drawing, which takes most of the time of a page."""

import pytest
from browser import open_browser
from paged import EVERY_KIND, make_pages


@pytest.fixture(scope="session")
def browser():
    with open_browser() as opened:
        yield opened


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """The page of every kind of result, by kind, with its figures drawn."""
    made = make_pages(tmp_path_factory.mktemp("pages"))
    assert made.keys() == set(EVERY_KIND)
    return made


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made, but not drawn."""
    monkeypatch.setattr("twin.report.page.to_svg", lambda figure: "<svg xmlns='http://www.w3.org/2000/svg'/>")
