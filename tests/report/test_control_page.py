"""The page of a comparison of controllers: what it says first, and that it holds every number."""

import base64
import json
import re

import pytest
from paged import control_results as values
from paged import control_total as total

from twin.report.control_page import headline
from twin.report.page import write_report

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def test_the_headline_names_the_best_of_the_first_condition_whoever_it_is():
    given = values(total("line", 4.0), total("pid", 1.0), total("ours", 2.0), total("line", 0.1, "other"))
    said = headline(given)
    assert said.startswith("pid follows references to 1.00 deg (RMSE) on 7 endoscopes")
    assert "50% less error than ours, the next best, and 75% less than line, the last." in said


def test_an_oracle_is_the_limit_and_no_rival():
    given = values(total("ours", 0.5), total("pid", 1.0), total("oracle", 0.125, oracle=True))
    said = headline(given)
    assert said.startswith("ours follows references to 0.50 deg")
    assert "(the limit, by an oracle, is 0.12 deg): 50% less error than pid, the next best." in said
    assert "oracle" in headline(values(total("oracle", 0.1, oracle=True)))


@pytest.mark.parametrize(("count", "end"), [(1, "R = 1."), (2, "the next best.")])
def test_the_headline_of_few_controllers_is_a_sentence_too(count, end):
    assert headline(values(*[total("a", 1.0), total("b", 2.0)][:count])).endswith(end)


def test_the_page_holds_every_figure_and_number(tmp_path):
    comparison = {
        "condition": "R = 1",
        "controller": "ours",
        "rival": "pid",
        "rmse_deg": 0.25,
        "rival_rmse_deg": 1.0,
        "reduction": 0.75,
        "reduction_ci95": [0.7, 0.8],
    }
    given = values(
        total("pid", 1.0),
        total("ours", 0.25, fallback_share=0.125),
        total("pid", 1.5, "bends"),
        comparisons=(comparison, comparison | {"condition": "bends", "rival": "nobody"}),
    )
    (tmp_path / "control.json").write_text(json.dumps(given))
    (tmp_path / "loops.png").write_bytes(PNG)
    text = write_report(tmp_path, tmp_path / "control.html").read_text()
    for said in ("75 %", "70 to 80 %", "fallback 12.5 %", "0.123", "1.2.3", "a &amp; b"):
        assert said in text
    assert f"endotwin control --controller pid ours --out {tmp_path}" in text
    assert "nobody" not in text
    (source,) = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert base64.b64decode(source) == PNG
    (row,) = re.findall(r"<tr><th[^>]*>ours</th>(.*?)</tr>", text)[:1]
    assert re.findall(r">([^<]+)<", row) == ["0.25", "0.50", "-"]


@pytest.mark.parametrize("damage", [{"totals": []}, {"control": {}}, {"tuned": [{"x": 1}]}, {"totals": 3}])
def test_a_damaged_control_json_is_one_line(tmp_path, damage):
    (tmp_path / "control.json").write_text(json.dumps(values(total("a", 1.0)) | damage))
    with pytest.raises(ValueError, match=r"control.json is not what `endotwin control` wrote: "):
        write_report(tmp_path, tmp_path / "report.html")
