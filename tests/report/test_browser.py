"""Pages in a browser, at the widths of a telephone and a desk: nothing is broken, fetched or cut off."""

import pytest
from browser import HEIGHT, WIDTHS
from paged import EVERY_KIND, make_dataset

from twin.report.report import write_report


def test_a_page_has_no_fault_and_its_slider_moves(browser, tmp_path, undrawn):
    page = write_report(make_dataset(tmp_path / "dataset"), tmp_path / "page.html")
    assert browser.faults(page, WIDTHS[0], axe=False) == []
    move = """
        const slider = document.querySelector(".player input");
        slider.value = arguments[0]; slider.dispatchEvent(new Event("input"));
        const dot = document.querySelector(".player .dot");
        return [document.querySelector(".player .body").getAttribute("points"), dot.getAttribute("cx"),
                document.querySelector(".player output").textContent];
    """
    begin, later = (browser.driver.execute_script(move, place) for place in (0, 60))
    assert begin[2].startswith("0.0 s, pull")
    assert later[2] > begin[2]
    assert begin[0] != later[0]
    assert begin[1] != later[1]


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_no_page_has_a_fault(browser, pages, kind, width):
    """No console error, no request, every image decoded, no overflow, WCAG AA (contrast, alternatives)."""
    assert browser.faults(pages[kind], width) == []
    answer = "return document.querySelector('header .headline').getBoundingClientRect().bottom"
    assert browser.ask(answer) < HEIGHT  # the answer is on the first screen


@pytest.mark.slow
def test_a_printed_page_has_tables_and_no_controls(browser, pages):
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        browser.open(pages["run"], 1280)
        height = "return [...document.querySelectorAll('{}')].map(e => e.getBoundingClientRect().height)"
        assert max(browser.ask(height.format(".controls, video"))) == 0
        assert min(browser.ask(height.format("details table, table"))) > 0
    finally:
        browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
