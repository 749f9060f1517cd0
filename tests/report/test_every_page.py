"""Every page in a browser, at the widths of a telephone and a desk: nothing is broken, fetched or cut off."""

import base64
import re

import pytest
from browser import WIDTHS
from paged import EVERY_KIND


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_a_page_has_no_fault(browser, pages, kind, width):
    """No console error, no request, every image decoded, no overflow, WCAG AA (contrast, alternatives)."""
    assert browser.faults(pages[kind], width) == []


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_page_is_one_file_that_loads_nothing_else(pages, kind):
    page = pages[kind].read_text()
    addresses = re.findall(r"""(?:src|srcset|href|xlink:href|action|data)\s*=\s*["']([^"']*)""", page)
    assert len(addresses) > 4
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert not re.search(r"<script src|<link rel=.stylesheet|@import|url\(\s*['\"]?http", page)
    assert [file.name for file in pages[kind].parent.iterdir() if file.name.startswith(".")] == []


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_page_has_the_same_parts(pages, kind):
    """Contents that lead to every section, a headline of one sentence, captions, versions and commands."""
    page = pages[kind].read_text()
    linked = re.findall(r'<li><a href="#([^"]*)">', page)
    assert linked == re.findall(r'<h2 id="([^"]*)"', page)
    assert linked[-1] == "how-to-repeat-it"
    assert "endotwin " in page.partition('id="how-to-repeat-it"')[2]
    (headline,) = re.findall(r'<p class="headline">(.*?)</p>', page, re.DOTALL)
    assert re.fullmatch(r"[A-Zo\d].*\.", headline)  # `ours` is the name of a controller
    assert len(re.findall(r"[a-z]\.(?= [A-Z])", headline)) == 0  # one sentence
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page, re.DOTALL)
    assert len(captions) == page.count("<figure") >= 1
    assert all(caption.endswith(".") for caption in captions)
    assert len(re.findall(r"<img alt=\"[^\"]{20,}", page)) == page.count("<img ")
    if kind not in ("run", "training"):  # the fixtures of these have no origin
        assert "<dt>endotwin</dt>" in page


def test_the_look_finds_every_kind_of_fault(browser, tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<!DOCTYPE html><html lang=en><title>bad</title><body style='color:#ddd;background:#fff'>"
        "<p>pale</p><img src='data:image/png;base64,AAAA'><div style='width:900px'>wide</div>"
        "<script>console.error('an error'); fetch('http://127.0.0.1:9/').catch(() => {});</script>"
    )
    found = "\n".join(browser.faults(page, 390))
    for fault in ("not decoded", "wider than the screen", "an error", "fetched: http://127.0.0.1:9/"):
        assert fault in found
    if browser.axe:
        assert "color-contrast" in found
        assert "image-alt" in found


def test_the_slider_moves_pose_and_loop(browser, pages):
    browser.open(pages["dataset"], 1280)
    ask = """
        const slider = document.querySelector(".player input");
        slider.value = arguments[0]; slider.dispatchEvent(new Event("input"));
        const dot = document.querySelector(".player .dot");
        return [document.querySelector(".player .body").getAttribute("points"), dot.getAttribute("cx"),
                document.querySelector(".player output").textContent];
    """
    begin, later = (browser.driver.execute_script(ask, place) for place in (0, 60))
    assert begin[2].startswith("0.0 s, pull")
    assert later[2] > begin[2]
    assert begin[0] != later[0]
    assert begin[1] != later[1]


def test_without_a_script_the_slider_is_hidden_and_its_figure_is_there(browser, pages):
    browser.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.open(pages["dataset"], 1280)
        shown = browser.driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
        assert len(base64.b64decode(shown["data"])) > 10_000
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
    assert '<div class="controls" hidden>' in pages["dataset"].read_text()


def test_a_printed_page_has_tables_and_no_controls(browser, pages):
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        browser.open(pages["run"], 1280)
        height = "return [...document.querySelectorAll('{}')].map(e => e.getBoundingClientRect().height)"
        assert max(browser.ask(height.format(".controls, video"))) == 0
        assert min(browser.ask(height.format("details table, table"))) > 0
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
