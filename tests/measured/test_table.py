"""CSV files that are none, or not as a logger writes them: one line that names the file and the line."""

import csv
import io
import math
import os
import re
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.measured import table as csv_table
from twin.measured.table import MISSING, read_columns

HEADER = b"time_s,command_deg,angle_deg\n"
SEMICOLONS = HEADER.replace(b",", b";")
ROWS = b"0,0,0\n1,1,1\n"


@pytest.fixture(autouse=True)
def few_at_once(monkeypatch):
    """Rows are worked off a few at a time, so that short files have several parts."""
    monkeypatch.setattr(csv_table, "_CELLS_AT_ONCE", 90)


def read(path, content=None):
    if content is not None:
        path.write_bytes(content)
    return read_columns(path, ("time_s", "command_deg", "angle_deg"))


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (HEADER + b"0,1,1,997\n", "line 2 has 4 fields, its header has 3; decimals need a point"),
        (HEADER + ROWS + b"2,1\n", "line 4 has 2 fields, its header has 3"),
        (HEADER + ROWS + b"2\n3,1,1\n", "line 4 has 1 field, its header has 3"),
        (HEADER + ROWS + b"2,1", "line 4 has 2 fields, its header has 3; the file ends within this line"),
        (b"a,b\n" + b"1,2,3\n", "line 2 has 3 fields, its header has 2"),
        (HEADER.replace(b",", b";") + b"0;0;0;0\n", "line 2 has 4 fields, its header has 3$"),
        (HEADER.replace(b",", b"|") + b"0|0|0\n", "its header has 1 column: .* or tabs, not by bars"),
        (HEADER.replace(b",", b" ") + b"0 0 0\n", "its header has 1 column: .* or tabs, not by spaces"),
        (b"t,knob;bend\n0,1;2\n", "its header has commas and semicolons, which may all separate"),
        (b"time_s,a;angle_deg\n0,1;2\n", "its header has commas and semicolons, which may all separate"),
        (
            SEMICOLONS + b"0;0,5;0\n\n1;1;1.5\n",
            r"line 4: angle_deg is '1\.5', and line 2: command_deg is '0,5': decimals must all have a point",
        ),
        (
            SEMICOLONS + b"0;0.5;0\n" + b"1;1;1\n" * 99 + b"1;1; 1,5\n",
            r"line 2: command_deg is '0\.5', and line 102: angle_deg is '1,5': decimals must",
        ),
        (HEADER + b'0,0,"0\n' + ROWS, "line 2: a quote of the row that begins here is never closed"),
        (HEADER + b'0,"' + b"1\n" * 70_000, "line 2: a field has more than 131072 characters: is a quote"),
        (HEADER + ROWS + b'2,"1"1,0\n', "line 4 is no line of a CSV file"),
        (HEADER + b"0,\x00,0\n", "is not a CSV file: line 2 holds a NUL byte"),
        ((HEADER + ROWS).decode().encode("utf-16-le"), "line 1 holds a NUL byte, .* text in UTF-16"),
        (b"1,2,3\n" + ROWS, "line 1 holds numbers: the file has no header, give `no_header`"),
        (HEADER + b"0," * (csv_table.LONGEST_LINE // 2 + 1), "line 2 has more than 1048576 characters"),
        (b"x" * (csv_table.LONGEST_LINE + 9), "line 1 has more than 1048576 characters"),
        (b"", "holds no lines of data"),
        (b"\n \n\n", "holds no lines of data"),
    ],
)
def test_what_is_no_csv_file_is_refused_in_one_line(tmp_path, content, fault):
    path = tmp_path / "log.csv"
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))}[^\n]* ?{fault}"):
        read(path, content)


@pytest.mark.parametrize(
    "content",
    [
        b"time_s,command_deg,angle_deg,\n0,0,0,\n1,1,1,\n",
        b"\n\n  \ntime_s,command_deg,angle_deg\n0,0,0\n\n1,1,1",
        b"\xef\xbb\xbftime_s,command_deg,angle_deg\r\n0,0,0\r\n1,1,1\r\n",
        b"time_s,command_deg,angle_deg\r0,0,0\r1,1,1\r",
        b'note,time_s,command_deg,angle_deg\n"two\nlines",0,0,0\n"a ""word""",1,1,1\n',
        "Maß,time_s,command_deg,angle_deg\n°,0, 0 ,0\n°,+1,1.e0,\t1\n".encode(),
        b"time_s;command_deg;angle_deg\n0;0;0\n1;1;1\n",
        b"\n \r\ntime_s;command_deg;angle_deg\r\n0;0;0\r\n1;1.0;1\r\n",
        b"time_s;command_deg;angle_deg\n0;0,0;-0,0\n1,000;1e0;+1,\n",
        b"\xef\xbb\xbftime_s\tcommand_deg\tangle_deg\r\n0\t0\t0\r\n1\t1,0\t,1e1\r\n",
        b'"a;b","c\td",time_s,command_deg,angle_deg\n"1,5;",x,0,0,0\n,,1,1,1\n',
        b'"force, N";time_s;command_deg;angle_deg\n2.5;0;0,0;0\n1.234,5;1;1,0;1\n',
        b"force, N;time_s;command_deg;angle_deg\n1;0;0;0\n1;1;1;1\n",
        b"time_s,command_deg,angle_deg,raw;x;y\n0,0,0,0\n1,1,1,1\n",
        (HEADER + ROWS).decode().encode("utf-16"),
        b"Ma\xdf," + HEADER + b"\xb0,0,0,0\n\xb0,1,1,1\n",
        b"Bench 3,,\nOperator:,time_s,\n\n" + HEADER + ROWS,
        b"# bent by 90 deg\n#\n" + HEADER + b"# begins\n" + ROWS,
        HEADER + b"[s],(deg),\xb0\n" + ROWS,
        HEADER + b"0,0,0,,\n1,1,1,\n",
    ],
)
def test_what_loggers_write_is_read(tmp_path, content):
    table = read(tmp_path / "log.csv", content)
    for name in ("time_s", "command_deg", "angle_deg"):
        np.testing.assert_array_equal(table.column(name), [0, 1])


@pytest.mark.parametrize("text", ["1.234,5", "1,234,567", "1,2.5", ",", "1,,5", "1_0,5", "0x1,5"])
def test_a_decimal_comma_groups_no_digits(tmp_path, text):
    table = read(tmp_path / "log.csv", SEMICOLONS + f"0;0;0\n1;{text};1\n".encode())
    with pytest.raises(ValueError, match=r"line 3: command_deg is .*, not a finite number"):
        table.column("command_deg", may_miss=True)


@pytest.mark.parametrize(
    "text", ["1_000", "\u0661", "0x10", "1e400", "infinity", "\xa01", "1 997", "1d3", "--1"]
)
def test_a_number_has_decimal_digits_and_a_point(tmp_path, text):
    table = read(tmp_path / "log.csv", HEADER + f"0,0,0\n1,{text},1\n".encode())
    with pytest.raises(ValueError, match=r"line 3: command_deg is .*, not a finite number"):
        table.column("command_deg", may_miss=True)


def test_only_a_regular_file_is_read_and_nothing_is_waited_for(tmp_path):
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    found = []

    def look():
        for path in (pipe, tmp_path):
            try:
                read(path)
            except ValueError as error:
                found.append(str(error))

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    thread.join(timeout=5)
    assert found == [
        f"{pipe} is a pipe or a device: must be a CSV file",
        f"{tmp_path} is a folder: must be a CSV file",
    ]
    with pytest.raises(ValueError, match="is a pipe or a device"):
        read(type(pipe)("/dev/zero"))


def test_a_file_and_its_rows_have_a_limit(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_bytes(HEADER + b"0,0,0\n" * 100)
    monkeypatch.setattr(csv_table, "MOST_ROWS", 60)
    monkeypatch.setattr(csv_table, "_CELLS_AT_ONCE", 30)
    with pytest.raises(ValueError, match="line 62: more than 60 rows, the most of a log"):
        read(path)
    monkeypatch.setattr(csv_table, "MOST_BYTES", 500)
    with pytest.raises(ValueError, match="has more than 0 GiB, the most that is read"):
        read(path)


FIELDS = st.one_of(
    st.floats(-1e9, 1e9).map(str),
    st.integers(-(10**6), 10**6).map(str),
    st.sampled_from(
        ["", "nan", " NA ", "1e400", "1_0", "\u0663", "inf", "x", '"', "1,5", "a\nb", "\x00", "0x1"]
    ),
)
LINES = st.lists(st.lists(FIELDS, min_size=2, max_size=4), max_size=8)


def expected(text):
    """Rows of a text read by `csv` alone; None where a reader must refuse it."""
    if "\0" in text:
        return None
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), strict=True))
    except csv.Error:
        return None
    rows = [row for row in rows if row and (len(row) > 1 or row[0].strip())]  # "," is a row of two gaps
    while rows and len(rows[0]) > 1 and not rows[0][-1].strip():
        rows[0].pop()
    for row in rows[1:]:
        while len(row) > len(rows[0]) and not row[-1].strip():
            row.pop()
    if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
        return None
    names = [name.strip() for name in rows[0]]
    places = [names.index(name) for name in ("x", "y") if name in names]
    return [[row[place] for place in places] for row in rows[1:]]


def number(text):
    """Number that a text of a column with gaps stands for; None where it is none."""
    if text.strip().lower() in MISSING:
        return math.nan
    plain = re.fullmatch(r"[ \t]*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?[ \t]*", text)
    return float(text) if plain and math.isfinite(float(text)) else None


@settings(max_examples=150, deadline=None)
@given(
    lines=LINES,
    quoted=st.booleans(),
    damage=st.sampled_from(["", '"', ",", "\r", ";", "\ufeff"]),
    place=st.integers(0),
)
def test_a_text_is_read_as_the_csv_module_reads_it_or_refused_with_its_line(
    tmp_path_factory, lines, quoted, damage, place
):
    text = io.StringIO()
    if quoted:
        csv.writer(text, lineterminator="\n").writerows([["x", "y"], *lines])
    else:
        text.write("\n".join(",".join(row) for row in [["x", "y"], *lines]))
    content = text.getvalue()
    place %= len(content) + 1
    content = content[:place] + damage + content[place:]
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content.encode())
    found = fault = None
    try:
        table = read_columns(path, ("x", "y"))
        found = [table.column(name, may_miss=True) for name in ("x", "y")]
    except ValueError as error:
        fault = str(error)
    rows = expected(content.removeprefix("\ufeff"))
    wanted = None if rows is None else [[number(field) for field in row] for row in rows]
    if fault is not None:
        assert re.match(rf"{re.escape(str(path))}( line \d+|:? [a-z ])", fault)
        assert "\n" not in fault
        assert len(fault) - len(str(path)) <= 200
        if "no column" not in fault and "more than one column" not in fault:
            assert wanted is None or any(None in row for row in wanted)
    else:
        assert wanted is not None
        np.testing.assert_array_equal(np.array(found).T, np.array(wanted, dtype=float).reshape(-1, 2))


def read_text(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "c.csv"
    path.write_bytes(text.encode(encoding))
    return read_columns(path, ("note", "x", "y", "t"))


def test_lines_are_those_of_the_file_where_some_are_blank(tmp_path):
    table = read_text(tmp_path, "x,t\n\n1,0\n\n\ninf,1\n3,0.5\n")
    assert table.lines.tolist() == [3, 6, 7]
    with pytest.raises(ValueError, match="line 6: x is 'inf'"):
        table.column("x")
    with pytest.raises(ValueError, match="line 7: t runs backwards"):
        table.time("t")
