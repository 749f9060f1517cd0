import numpy as np
import pytest

from twin.measured.csv_columns import average_repeats, hold
from twin.measured.csv_reader import read_columns


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "c.csv"
    path.write_bytes(text.encode(encoding))
    return read_columns(path, ("note", "x", "y", "t"))


def test_only_the_columns_asked_for_must_be_numbers(tmp_path):
    table = read(tmp_path, "note,x, y \nfirst,1,2\n,3,4e1\n")
    assert table.names == ("note", "x", "y")
    np.testing.assert_array_equal(table.column("y"), [2, 40])
    with pytest.raises(ValueError, match=r"c\.csv line 2: note is 'first', not a finite number"):
        table.column("note")


def test_a_mark_before_the_header_is_no_part_of_a_name(tmp_path):
    assert read(tmp_path, "x,y\n1,2\n", encoding="utf-8-sig").names == ("x", "y")


def test_lines_are_those_of_the_file_where_some_are_blank(tmp_path):
    table = read(tmp_path, "x,t\n\n1,0\n\n\ninf,1\n3,0.5\n")
    assert table.lines.tolist() == [3, 6, 7]
    with pytest.raises(ValueError, match="line 6: x is 'inf'"):
        table.column("x")
    with pytest.raises(ValueError, match="line 7: t runs backwards"):
        table.time("t")


def test_only_the_columns_asked_for_are_kept(tmp_path):
    table = read(tmp_path, "x,other,y\n1,2,3\n")
    assert table.columns.keys() == {"x", "y"}
    assert table.names == ("x", "other", "y")


def test_a_column_that_is_not_there_or_there_twice_is_refused_with_the_others(tmp_path):
    table = read(tmp_path, "x,y,y\n1,2,3\n")
    with pytest.raises(ValueError, match="has no column z; its columns: x, y, y"):
        table.column("z")
    with pytest.raises(ValueError, match="has more than one column y"):
        table.column("y")
    assert table.first_of(("z", "x")) == "x"
    with pytest.raises(ValueError, match="has no column z or w; its columns: x"):
        table.first_of(("z", "w"))


@pytest.mark.parametrize("content", [b"", b"x,y\n", b"x,y\n\n"])
def test_a_file_without_data_is_refused(tmp_path, content):
    (tmp_path / "c.csv").write_bytes(content)
    with pytest.raises(ValueError, match="holds no lines of data"):
        read_columns(tmp_path / "c.csv", ("x",))


def test_values_of_one_time_are_averaged_column_by_column():
    time = np.array([0.0, 0.0, 0.5, 2.0, 2.0, 2.0])
    values = np.array([[1, 10], [3, 30], [5, 50], [1, 0], [2, 0], [6, 3]], dtype=float)
    instants, means = average_repeats(time, values)
    np.testing.assert_array_equal(instants, [0, 0.5, 2])
    np.testing.assert_allclose(means, [[2, 20], [5, 50], [3, 1]])
    np.testing.assert_allclose(average_repeats(time, values[:, 0])[1], [2, 5, 3])


def test_a_mean_is_over_the_values_that_are_there():
    values = np.array([[1, np.nan], [np.nan, np.nan], [4, 2]])
    np.testing.assert_array_equal(
        average_repeats(np.array([0.0, 0.0, 1.0]), values)[1], [[1, np.nan], [4, 2]]
    )


def test_a_value_may_be_missing_only_where_that_is_allowed(tmp_path):
    words = ["", "nan", "-NaN", " NA ", "n/a", "#N/A", "NULL", "None"]
    table = read(tmp_path, "x,y\n" + "".join(f"1,{word}\n" for word in words) + "1,\n1,2\n")
    np.testing.assert_array_equal(table.column("y", may_miss=True), [np.nan] * 9 + [2])
    with pytest.raises(ValueError, match="line 2: y is ''"):
        table.column("y")
    for wrong in ("missing", "inf", "-Infinity", "1e999", "1;5"):
        with pytest.raises(ValueError, match=f"line 2: y is '{wrong}', not a finite number"):
            read(tmp_path, f"x,y\n1,{wrong}\n").column("y", may_miss=True)


def test_rows_that_are_left_keep_their_lines(tmp_path):
    said = []
    table = read(
        tmp_path, "t\n" + "".join(f"{t}\n" for t in [*range(9), "na", 4, 8, 3.5, "nan", *range(9, 20)])
    )
    timed = table.timed("t", said.append)
    ordered = timed.in_order("t", said.append)
    np.testing.assert_array_equal(ordered.column("t"), [*range(9), 8, *range(9, 20)])
    assert ordered.lines.tolist() == [*range(2, 11), 13, *range(16, 27)]
    assert [line.partition(".csv ")[2] for line in said] == [
        "line 11: t is missing, as in 2 of 25 rows: such rows are dropped",
        "line 12: t runs backwards, as in 2 of 23 rows: such rows are dropped",
    ]
    np.testing.assert_array_equal(timed.in_order("t").lines, ordered.lines)


def test_what_is_held_is_the_last_value_there_was():
    np.testing.assert_array_equal(hold(np.array([np.nan, 1, np.nan, np.nan, 2, 3])), [np.nan, 1, 1, 1, 2, 3])
