"""Tables of a comparison: every figure in its row and column, and nothing where there is none."""

from twin.control.tables import TABLE, control_table, write_tables


def total(controller, rmse, condition="R = 1", **others):
    return {
        "controller": controller,
        "condition": condition,
        "rmse_deg": rmse,
        "worst_twin_rmse_deg": 2 * rmse,
        "late_rmse_deg": 3 * rmse,
        "late_worst_deg": 4 * rmse,
        "travel_mm": 10 * rmse,
    } | others


TOTALS = [total("pid", 1.0), total("ours", 0.25), total("pid", 1.5, "bends")]


def rows_of(text):
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|") and ":--" not in line
    ]


def test_conditions_are_rows_controllers_columns_and_the_last_row_is_the_way():
    assert rows_of(control_table(TOTALS)) == [
        ["condition", "pid", "ours"],
        ["R = 1", "1.00 (2.00)", "0.25 (0.50)"],
        ["bends", "1.50 (3.00)", ""],
        ["way of the command, R = 1 [mm]", "10.0", "2.5"],
    ]


def test_the_file_has_late_errors_ways_differences_and_each_reference(tmp_path):
    rows = [
        total("pid", 1.0, signal="sine", stroke_mm=[-1.0, 1.0]),
        total("ours", 0.3, signal="sine", stroke_mm=[2.0, 4.5]),
    ]
    against = [
        {
            "condition": "bends",
            "controller": "ours",
            "rival": "pid",
            "reduction": 0.75,
            "reduction_ci95": [0.7, 0.8],
        }
    ]
    write_tables(tmp_path, {"totals": TOTALS, "rows": rows, "comparisons": against})
    text = (tmp_path / TABLE).read_text()
    found = rows_of(text)
    assert ["R = 1", "3.00 (4.0)", "0.75 (1.0)"] in found
    assert ["bends", "15.0", ""] in found
    assert ["bends", "75 % (70 to 80)"] in found
    assert "How much less error ours has" in text
    assert ["R = 1: sine, [-1, 1] mm", "1.00 (2.00)", ""] in found
    assert ["R = 1: sine, [2, 4.5] mm", "", "0.30 (0.60)"] in found


def test_without_one_of_our_own_nothing_is_compared(tmp_path):
    write_tables(tmp_path, {"totals": TOTALS, "rows": [], "comparisons": []})
    assert "less error" not in (tmp_path / TABLE).read_text()
