"""Rows of `evaluation.json`: one typed record, one reader that refuses what is damaged."""

import dataclasses
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scores import SCORE

from twin.evaluation.score import Score, read_evaluation

WHOLE = dataclasses.replace(
    SCORE,
    twin="nominal",
    md_printed_deg2=0.3,
    paper_rmse_deg=0.6354,
    coverage95=0.94,
    width95_deg=1.3,
    nees=1.1,
    nis=1.2,
    crps_deg=0.2,
    to_best_ci95=(1.1, 1.4),
    is_best=True,
)
OPTIONAL = {
    "given",
    "stroke_mm",
    "twin",
    "md_printed_deg2",
    "paper_rmse_deg",
    "coverage95",
    "width95_deg",
    "nees",
    "nis",
    "crps_deg",
    "training_rmse_deg",
    "to_best_ci95",
    "is_best",
}


def write(path, rows):
    path.write_text(json.dumps({"protocol": {"suite": "paper"}, "rows": rows}))
    return path


def test_a_row_comes_back_from_its_file(tmp_path):
    scores, contents = read_evaluation(write(tmp_path / "evaluation.json", [WHOLE.to_dict()]))
    assert scores == [WHOLE]
    assert contents["protocol"] == {"suite": "paper"}


@pytest.mark.parametrize("name", sorted(WHOLE.to_dict()))
def test_a_row_without_a_key_is_refused_by_its_name(name, tmp_path):
    row = {key: value for key, value in WHOLE.to_dict().items() if key != name}
    path = write(tmp_path / "evaluation.json", [WHOLE.to_dict(), row])
    if name in OPTIONAL:
        assert len(read_evaluation(path)[0]) == 2
        return
    with pytest.raises(ValueError, match=f"evaluation.json: row 1: a row has no {name}$"):
        read_evaluation(path)


@pytest.mark.parametrize("name", sorted(WHOLE.to_dict()))
@given(value=st.sampled_from([None, [], [1], {}, "x", 1.5, True, float("nan"), -1]))
def test_a_value_of_the_wrong_kind_is_refused_or_of_the_right_kind(name, value):
    row = WHOLE.to_dict() | {name: value}
    try:
        score = Score.from_dict(row)
    except ValueError as error:
        assert str(error).startswith(f"{name} = ")  # noqa: PT017  both ends are allowed
    else:
        assert type(getattr(score, name)) is type(getattr(WHOLE, name)) or value is None


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"rows": 3, "protocol": {}}', '{"rows": []}', "\x00"])
def test_what_is_no_result_is_refused_in_one_line(content, tmp_path):
    path = tmp_path / "evaluation.json"
    path.write_text(content)
    with pytest.raises(ValueError, match="is not the results of an evaluation") as error:
        read_evaluation(path)
    assert "\n" not in str(error.value)


def test_an_oracle_is_labelled_once():
    named = Score.from_dict(WHOLE.to_dict() | {"method": "RAM (oracle)", "oracle": True})
    assert (WHOLE.label, named.label) == ("RAM", "RAM (oracle)")
    assert Score.from_dict(WHOLE.to_dict() | {"oracle": True}).label == "RAM (oracle)"
