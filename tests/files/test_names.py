"""Names of files that a user chooses."""

import pytest

from twin.files.bounds import check_file_name


@pytest.mark.parametrize(
    "name", ["log", "Log 2, left (new)", "Gerät-7", "a.b", "log 12:30:01", "日本", "x" * 120]
)
def test_a_plain_name_is_taken(name):
    check_file_name(name)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("", "must be the name of a file"),
        (".log", "must be the name of a file"),
        ("a/b", "must be the name of a file"),
        ("two\nlines", "must be one line of printable characters"),
        ("\x1b[31m", "must be one line of printable characters"),
        ("\u202egpj", "must be one line of printable characters"),
        ("\udcff", "must be one line of printable characters"),
        (" log", "without blanks around"),
        ("<b>", "must be without any of <"),
        ("a|b", "must be without any of <"),
        ("x" * 121, "must have at most 120 characters"),
        ("日" * 101, "must have at most 200 bytes"),
    ],
)
def test_another_one_is_refused_in_a_short_line(name, rule):
    with pytest.raises(ValueError, match=rule) as caught:
        check_file_name(name)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) <= 120
