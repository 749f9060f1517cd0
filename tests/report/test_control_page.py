"""The page of a comparison of controllers: what it says first, that it holds all, and loads nothing."""

import base64
import re

import pytest

from twin.report.control_page import headline, write_control_page

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def total(controller, rmse, condition="R = 1", **others):
    return {
        "controller": controller,
        "oracle": False,
        "condition": condition,
        "rmse_deg": rmse,
        "worst_twin_rmse_deg": 2 * rmse,
        "late_rmse_deg": 3 * rmse,
        "late_worst_deg": 4 * rmse,
        "travel_mm": 11.0,
        "fallback_share": 0.0,
    } | others


def values(*totals, comparisons=()):
    control = {
        "version": "1.2.3",
        "policy_sha256": None,
        "preset": "a & b",
        "physics": "mujoco",
        "twins": 7,
        "seconds": 40.0,
        "limits": [{"low_mm": -4.0, "high_mm": 4.0, "speed_mm_s": 5.0}],
        "sensor_latency_s": 0.0,
        "candidates": 16,
        "tuning_seconds": 12.0,
        "seed": 3,
    }
    tuned = [
        {
            "controller": "pid",
            "noise_variance_deg2": 1.0,
            "sample_time_s": 0.02,
            "settings": {"gain": 0.123456},
            "rmse_deg": 0.7,
            "tried": 16,
        }
    ]
    return {"control": control, "totals": list(totals), "comparisons": list(comparisons), "tuned": tuned}


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


def test_the_page_holds_every_figure_and_number_and_loads_nothing(tmp_path):
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
        comparisons=[comparison, comparison | {"condition": "bends", "rival": "nobody"}],
    )
    page = write_control_page(given, [(PNG, "what <it> shows")], tmp_path / "control.html", "endotwin it")
    text = page.read_text()
    for said in ("75 %", "70 to 80 %", "fallback 12.5 %", "0.123", "1.2.3", "endotwin it", "a &amp; b"):
        assert said in text
    assert "nobody" not in text
    assert "what &lt;it&gt; shows" in text
    (source,) = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert base64.b64decode(source) == PNG
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert "<script" not in text
    assert "<td>bends</td><td>1.50<small>3.00</small></td><td>-</td>" in text
    # Each link of the table of contents has its section.
    assert set(re.findall(r'href="#(\w+)"', text)) == set(re.findall(r'<h2 id="(\w+)"', text))
