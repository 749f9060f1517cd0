"""Every measured number of the documents comes from a file of docs/data, and is as that file has it."""

import json
import re
import sys

import pytest
from repository import REPOSITORY

from scripts.studies import tables
from scripts.studies.comparison_data import write_comparison
from scripts.studies.tables import FIGURE, TABLE, documents, main, read_data, written
from twin.errors import InputError, MissingFileError

sys.path.insert(0, str(REPOSITORY / "docs/site"))

import tutorials

FREE = {"CHANGELOG.md", "docs/site/equations.md"}
"""Documents that need no files: changes, and formulas."""
NOT_PROSE = (
    TABLE,
    FIGURE,
    re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE),
    re.compile(r"`[^`\n]*`"),
    re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.DOTALL),
    re.compile(r"\]\([^)]*\)"),
    re.compile(r"^#+ .*$", re.MULTILINE),
)
"""What has no figures, or figures from files."""
_NUMBER = r"[-+±]*\d[\d.,]*"
SETTINGS = tuple(
    re.compile(pattern)
    for pattern in (
        rf"(?:{_NUMBER}(?:\s+(?:to|and|or)\s+|[;/]?\s+)?)+[^\s\d<]*(?: [^\s\d<]+)?<!-- setting -->",
        rf"\b(?:[A-Za-zλμφ]|lambda|mu|phi) ?[=<>] ?{_NUMBER}(?: %)?",  # T = 0.1 s, R = 0.1
        rf"\[{_NUMBER}, {_NUMBER}\]",  # a stroke
        rf"(?:Poisson|Gaussian|lambda|[Ll]ognormal|Weibull|gamma|dithered)(?: noise)?(?: of)?,? {_NUMBER}",
        r"\b9[05] % (?:confidence )?(?:interval|within)s?",
        r"(?:Python |Newton |version |Apache-|\bv)\d+\.[\d.]*\d",
    )
)
"""Numbers that someone chose: parameters, strokes, noise, versions, and those before `<!-- setting -->`."""
MEASURED = re.compile(r"\d+\.\d+|\d\s?%|\d\s+times\b")


def bare_numbers(text: str) -> list[str]:
    """Measured numbers of a document that have no file behind them, each with the words around it."""
    for pattern in (*NOT_PROSE, *SETTINGS):
        text = pattern.sub(" _ ", text)
    return [text[max(found.start() - 40, 0) : found.end() + 20] for found in MEASURED.finditer(text)]


PAGES = {str(path.relative_to(REPOSITORY)): path.read_text() for path in documents()}
PAGES |= {f"docs/tutorials/{name}.py": text for name, text in tutorials.pages().items()}


@pytest.mark.parametrize("name", sorted(PAGES.keys() - FREE))
def test_every_measured_number_of_a_document_has_a_file_behind_it(name):
    assert not bare_numbers(PAGES[name])


def test_documents_are_as_their_files_have_them(capsys):
    assert main(["--check"]) == 0, capsys.readouterr().err


def test_every_file_of_data_is_complete_and_shown_or_linked():
    text = "".join(PAGES.values())
    for path in sorted((REPOSITORY / tables.DATA).iterdir()):
        assert path.name in text, f"{path.name}: no document has it"
        if path.name != "scores.csv":  # its rows are named by several columns
            assert read_data(path)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("It has 1.63 deg.", 1),
        ("It is 9 % better, and 3 times as fast.", 2),
        ("| RAM | 0.31 |", 1),
        ("With R = 0.1 on [-2.5, 2.5] mm, Poisson 0.1 and a 95 % interval.", 0),
        ("From 0.3 to 1<!-- setting --> deg, and `0.5`.", 0),
        ("It has 1.63<!-- rivals.csv, RAM (twins), times the limit --> times.", 0),
        ("It has 1.63<!-- measured --> times.", 1),
        ("Its RMSE = 0.55 deg.", 1),
    ],
)
def test_a_measured_number_is_told_from_a_setting(text, found):
    assert len(bare_numbers(text)) == found


DATA_FILE = """# commit: 0123
# command: endotwin demo
# date: 2026-11-27
# versions: endotwin 0.1.0
method,RMSE,low,high
RAM,0.5449,0.51,0.58
AM,2,,
"""


@pytest.fixture
def data(tmp_path):
    (tmp_path / "some.csv").write_text(DATA_FILE)
    read_data.cache_clear()
    return tmp_path


def test_a_table_has_the_chosen_rows_columns_and_decimals(data):
    mark = "<!-- table: some.csv | rows: R.* | method | RMSE:.2f | 95 %: {RMSE:.1f} ({low} to {high}) -->"
    text = written(f"{mark}\nold\n<!-- end -->", data)
    rows = "| method | RMSE | 95 % |\n| --- | --- | --- |\n| RAM | 0.54 | 0.5 (0.51 to 0.58) |\n"
    assert text == f"{mark}\n\n{rows}\n<!-- end -->"
    assert written(text, data) == text


def test_empty_cells_are_dashes_and_leave_no_brackets(data):
    mark = "<!-- table: some.csv | rows: AM | low | .2f | e: {RMSE} ({low} to {high}) -->"
    assert "| - | 2.00 |" in written(f"{mark}\n<!-- end -->", data)


def test_a_figure_keeps_its_decimals_and_takes_the_value_of_its_cell(data):
    sentence = "It has {} deg<!-- some.csv, RAM, RMSE -->."
    assert written(sentence.format("9.99"), data) == sentence.format("0.54")
    assert written(sentence.format("7"), data) == sentence.format("1")


@pytest.mark.parametrize(
    "text",
    [
        "1<!-- other.csv, RAM, RMSE -->",
        "1<!-- some.csv, RUM, RMSE -->",
        "1<!-- some.csv, RAM, MAE -->",
        "1<!-- some.csv, AM, low -->",
        "<!-- table: some.csv | rows: KF -->\n<!-- end -->",
        "<!-- table: some.csv | MAE -->\n<!-- end -->",
    ],
)
def test_a_mark_without_its_number_is_refused(data, text):
    with pytest.raises((InputError, MissingFileError), match=r"(some|other)\.csv"):
        written(text, data)


def test_check_names_a_document_that_differs_and_writing_mends_it(data, monkeypatch, capsys):
    monkeypatch.setattr(tables, "ROOT", data)
    (data / "docs/data").mkdir(parents=True)
    (data / "some.csv").rename(data / "docs/data/some.csv")
    (data / "CONTRIBUTING.md").touch()
    (data / "README.md").write_text("9.99<!-- some.csv, RAM, RMSE -->")
    assert main(["--check"]) == 1
    assert "README.md" in capsys.readouterr().err
    assert main([]) == 0
    assert main(["--check"]) == 0
    assert (data / "README.md").read_text().startswith("0.54")


@pytest.mark.parametrize("wrong", [DATA_FILE.replace("# date", "# day"), DATA_FILE + "RAM,1,,\n"])
def test_a_file_without_its_origin_or_with_equal_rows_is_refused(data, wrong):
    (data / "some.csv").write_text(wrong)
    with pytest.raises(InputError, match="first"):
        read_data(data / "some.csv")


def test_a_run_of_the_full_suite_becomes_files(tmp_path):
    columns = "method,oracle,noise,level,sample_time_s,stroke_low_mm,stroke_high_mm,twin,rmse_deg,coverage95"
    lines = [
        f'"{method}",false,gaussian,{R},0.1,-1,1,nominal,{rmse},{covered},2,1'
        for R in (1, 5)
        for method, rmse, covered in [
            ("Ensemble (limit)", 1, 0.9),
            ("RAM (twins)", 2, ""),
            ("AM", 1.5, 0.5),
            ("RAM (twins), filter alone", 1.2, 0.9),
        ]
    ]
    (tmp_path / "scores.csv").write_text("\n".join([f"{columns},seeds,trainings", *lines]) + "\n")
    (tmp_path / "costs.csv").write_text("method,sample_us\nAM,3\n")
    origin = {"command": "endotwin evaluate --suite full", "versions": {"endotwin": "0.1.0"}, "data": []}
    given = [{"method": "AM", "given": ["R", "zero"]}]
    (tmp_path / "evaluation.json").write_text(json.dumps({"rows": given, "origin": origin}))
    (tmp_path / "data").mkdir()
    write_comparison(tmp_path, tmp_path / "data", "0123")
    rivals = read_data(tmp_path / "data/rivals.csv")
    assert list(rivals) == ["Ensemble (limit)", "RAM (twins), filter alone", "AM", "RAM (twins)"]
    assert rivals["AM"]["knows"] == "R, zero"
    assert float(rivals["AM"]["times the limit"]) == 1.5
    assert float(rivals["AM"]["coverage [%]"]) == 50
    assert {row["best method"] for row in read_data(tmp_path / "data/better_cells.csv").values()} == {"AM"}
    assert read_data(tmp_path / "data/rmse_groups.csv")["AM"]["the preset [-1; 1] mm"] == "1.5"
    assert "# command: endotwin evaluate --suite full" in (tmp_path / "data/scores.csv").read_text()


def test_a_comparison_of_controllers_becomes_files(tmp_path):
    def total(controller, condition, rmse_deg, oracle=False):
        more = {"worst_twin_rmse_deg": 2 * rmse_deg, "travel_mm": 5.0, "holding_reversals_per_s": 0.1}
        facts = {"controller": controller, "condition": condition, "oracle": oracle}
        return facts | more | {"rmse_deg": rmse_deg, "percent_of_uncompensated": 50.0}

    totals = [total("pid", "all conditions", 2.0), total("oracle", "all conditions", 0.5, oracle=True)]
    totals += [total("line", "all conditions", 4.0), total("pid", "1", 2.0), total("line", "1", 1.0)]
    against = {"condition": "all conditions", "rival": "line", "reduction": 0.5, "reduction_ci95": [0.4, 0.6]}
    tuned = [{"controller": "pid", "settings": {"lead_s": lead}} for lead in (0.1, 0.3)]
    origin = {"command": "endotwin control", "versions": {"endotwin": "0.1.0"}, "data": []}
    values = {"control": {"test_set": "ab"}, "totals": totals, "comparisons": [against], "tuned": tuned}
    (tmp_path / "control.json").write_text(json.dumps(values | {"origin": origin}))
    (tmp_path / "data").mkdir()
    write_comparison(tmp_path, tmp_path / "data", "0123")
    rows = read_data(tmp_path / "data/control_sealed_totals.csv")
    assert [row["best in"] for row in rows.values()] == ["0", "0", "1"]
    assert (rows["pid"]["largest lead [s]"], rows["line"]["high"], rows["pid"]["low"]) == ("0.30", "60", "")
    under = read_data(tmp_path / "data/control_sealed.csv")["1"]
    assert (under["line"], under["line, worst"], under["oracle"]) == ("1.00", "2.00", "")
    values |= {"control": {"test_set": None}, "totals": totals[:2], "origin": origin}
    (tmp_path / "control.json").write_text(json.dumps(values))
    write_comparison(tmp_path, tmp_path / "data", "0123")
    names = {path.name for path in (tmp_path / "data").glob("*.csv")}
    assert names == {"control_sealed_totals.csv", "control_sealed.csv", "control_totals.csv"}
