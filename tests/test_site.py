"""The site of the documents: built without a network or a warning, whole, and looked at in a browser."""

import functools
import http.server
import re
import subprocess
import sys
import threading

import nbformat
import pytest
from browser import WIDTHS, open_browser
from repository import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "docs/site"))

import build
import estimators

from scripts.__main__ import VERBS
from twin.estimation.registry import method_specs


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site; a warning of the builder, such as a dead link or anchor, is a failure."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, REPOSITORY / "docs/site/build.py", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "arning" not in done.stdout + done.stderr
    return out / "site"


@pytest.fixture(scope="module")
def served(site):
    handler = functools.partial(Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


def faults_of(browser, served, page):
    return [fault for width in WIDTHS for fault in browser.faults(served + page, width, served)]


@pytest.mark.slow
def test_no_page_at_all_has_a_fault_in_a_browser(site, served):
    for name in build.nav_pages():
        assert (site / name).with_suffix(".html").is_file(), name
        assert not name.startswith("tutorials/") or (site / name).with_suffix(".ipynb").is_file(), name
    pages = [str(path.relative_to(site)) for path in sorted(site.rglob("*.html"))]
    with open_browser() as browser:
        found = {page: faults_of(browser, served, page) for page in pages}
    assert not {page: faults for page, faults in found.items() if faults}


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(site):
    for path in site.rglob("*.html"):
        assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?:https?:)?//', path.read_text()), (
            path
        )


@pytest.mark.slow
def test_every_link_of_a_notebook_opens_in_the_site(site):
    links = [
        (notebook.name, address)
        for notebook in site.rglob("*.ipynb")
        for cell in nbformat.read(notebook, 4).cells
        if cell.cell_type == "markdown"
        for address in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", cell.source)
    ]
    assert len(links) > 6
    for name, address in links:
        assert not address.endswith(".md"), (name, address)
        assert (site / "tutorials" / address).is_file(), (name, address)


def test_every_document_is_in_the_navigation():
    named = set(build.nav_pages())
    documents = {str(path.relative_to(REPOSITORY / "docs")) for path in (REPOSITORY / "docs").rglob("*.md")}
    assert {name for name in documents if not name.startswith("site/")} <= named
    assert {f"tutorials/{path.stem}.md" for path in (REPOSITORY / "docs/tutorials").glob("*.py")} <= named


@pytest.mark.slow
def test_the_reference_has_every_verb_option_and_name(site):
    import twin

    text = (site / "reference/commands.html").read_text()
    for verb in VERBS:
        assert f'id="{verb}"' in text
    for option in ("--sheath-bend-to-deg", "--tracking-policy", "--initial-bend-deg"):
        assert option in text
    python = (site / "reference/python.html").read_text()
    for name in twin.__all__:
        assert f'id="twin-{name.lower()}"' in python


@pytest.mark.slow
def test_every_estimator_has_its_page_with_equations(site):
    for spec in method_specs():
        text = (site / f"estimators/{estimators.slug(spec.name)}.html").read_text()
        assert "<math" in text, spec.name
    names = {name for name in estimators.equations() if not name.startswith("model ")}
    assert names == {spec.name for spec in method_specs()}
