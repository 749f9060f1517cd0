"""Tables of a comparison: every figure in its row and column, and nothing where there is none."""

from twin.control.results import control_table


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
