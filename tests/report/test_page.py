"""Parts of a page: every text is escaped, and a page is one file that loads nothing."""

import re

import numpy as np
import pytest
from markupsafe import Markup
from rendered import make_episode

from twin.report.figures import loop_figure
from twin.report.page import (
    Cell,
    Page,
    bullets,
    commands,
    facts,
    figure,
    film,
    folded,
    gap,
    side_by_side,
    table,
    text,
)
from twin.report.player import player

BAD = '<script>alert("1")</script>&'
LINE = np.linspace(0.0, 1.0, 5)
PARTS = {
    "text": text(BAD, "note"),
    "bullets": bullets([BAD]),
    "table": table((BAD, BAD), [(BAD, Cell(BAD, (BAD,), "best"))], title=BAD, note=BAD, cards=True),
    "facts": facts({BAD: [(BAD, BAD)]}),
    "figure": figure(loop_figure([(LINE, LINE)]), BAD, BAD),
    "film": film(b"....ftyp", BAD),
    "gap": gap(BAD, BAD),
    "commands": commands([BAD]),
    "folded": folded(BAD, text(BAD)),
    "side by side": side_by_side(text(BAD), text(BAD)),
    "player": player(make_episode(), BAD),
}


@pytest.mark.parametrize("part", PARTS)
def test_text_cannot_become_markup(part):
    html = str(PARTS[part])
    assert "<script>alert" not in html
    assert "&lt;script&gt;alert(&#34;1&#34;)&lt;/script&gt;&amp;" in html


def test_own_markup_is_kept():
    assert "<p><b>x</b> &lt;</p>" in text(Markup("<b>x</b> {}").format("<"))


def test_a_page_is_one_file_with_a_table_of_contents(tmp_path):
    page = Page("kind", "A & B", verdict="go", intro=(text("intro"),))
    page.add("First, of two", *PARTS.values())
    page.add_origin(["endotwin report x"], {"Settings": [("seed", "3")]})
    html = page.write(tmp_path / "page.html").read_text()
    assert re.findall(r'<li><a href="#([^"]*)">', html) == re.findall(r'<h2 id="([^"]*)"', html)
    assert re.findall(r'<h2 id="([^"]*)"', html) == ["first-of-two", "how-to-repeat-it"]
    addresses = re.findall(r"""(?:src|srcset|href|action|data)\s*=\s*["']([^"']*)""", html)
    assert addresses
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert html.count("<script>") == 1  # of the slider
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
