"""Numbers and names that a user gives have bounds, which are checked before any work."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rl.comparison.settings import Suite
from twin.evaluation.protocol import Protocol
from twin.files.bounds import check_between, check_file_name
from twin.identification import check_options


@given(
    value=st.floats() | st.integers(-(10**6000), 10**6000),
    bounds=st.tuples(st.integers(-9, 9), st.integers(-9, 9)),
)
def test_a_number_is_within_its_bounds_or_refused_in_a_short_line(value, bounds):
    least, most = sorted(bounds)
    if least <= value <= most:
        check_between("pace", value, least, most, "s")
        return
    with pytest.raises(ValueError, match=rf"^pace = .{{1,40}}: must be from {least} to {most} s$"):
        check_between("pace", value, least, most, "s")


def full_suite(**given):
    return Suite((), "folder", **{"suite": "full", "sample_time": (0.1,), "workers": 1} | given)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -1e300])
@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (Protocol, "initial_error_deg"),
        (Protocol, "sample_time_s"),
        (Protocol, "recorded_variance"),
        (full_suite, "seconds"),
        (full_suite, "initial_error_deg"),
        (lambda **given: full_suite(sample_time=tuple(given.values())), "sample_time"),
    ],
)
def test_no_number_that_is_not_finite_or_huge_is_taken(settings, name, wrong):
    with pytest.raises(ValueError, match=r"^[^\n]{1,160}$"):
        settings(**{name: wrong})


@pytest.mark.parametrize("wrong", [0, -1, 10**5000], ids=["zero", "negative", "huge"])
@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (Protocol, "seeds"),
        (full_suite, "members"),
        (full_suite, "episodes"),
        (full_suite, "workers"),
        (full_suite, "seeds"),
        (lambda **given: check_options("bouc-wen", **given), "population"),
        (lambda **given: check_options("bouc-wen", **given), "generations"),
    ],
)
def test_no_count_that_never_ends_is_taken(settings, name, wrong):
    with pytest.raises(ValueError, match=r"^[^\n]{1,160}$"):
        settings(**{name: wrong})


@pytest.mark.parametrize("name", ["log", "Log 2, left (new)", "Gerät-7", "log 12:30:01", "日本", "x" * 120])
def test_a_plain_name_is_accepted(name):
    check_file_name(name)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("", "must be the name of a file"),
        (".log", "must be the name of a file"),
        ("a/b", "must be the name of a file"),
        ("two\nlines", "must be one line of printable characters"),
        ("\u202egpj", "must be one line of printable characters"),
        ("\udcff", "must be one line of printable characters"),
        (" log", "without blanks around"),
        ("a|b", "must be without any of <"),
        ("x" * 121, "must have at most 120 characters"),
        ("日" * 101, "must have at most 200 bytes"),
    ],
)
def test_another_name_is_refused_in_a_short_line(name, rule):
    with pytest.raises(ValueError, match=rule) as caught:
        check_file_name(name)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) <= 120
