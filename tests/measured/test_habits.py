"""Logs as laboratories write them: read to the same samples, warned of, or refused; never misread."""

import datetime

import numpy as np
import pytest

from twin.measured.log import LogFormat, oddities, read_measured_log, read_windows
from twin.measured.look import look

COUNT, T = 400, 0.02
TIME = np.arange(COUNT) * T
PULL = np.round(3 * np.sin(2 * np.pi * 0.3 * TIME), 5)
BEND = np.round(9 * np.interp(TIME - 0.1, TIME, PULL), 5)
START = datetime.datetime(2026, 3, 29, 1, 59, 57, tzinfo=datetime.UTC)  # clocks are set forward at 2:00
MM = {"command_column": "pull_mm"}


def rows(time, pull=PULL, bend=BEND, mark=",", end=""):
    """Lines of a log; a value of None is an empty field."""
    values = zip(time, pull, bend, strict=True)
    return "".join(mark.join("" if of is None else f"{of}" for of in row) + end + "\n" for row in values)


def stamped(form):
    return [form(START + datetime.timedelta(seconds=second)) for second in TIME]


SECONDS = [f"{second:.3f}" for second in TIME]
HEAD = "time_s,pull_mm,angle_deg\n"
NANO = [1_700_000_000_000_000_000 + round(second * 1e9) for second in TIME]
SPLIT = "\n".join(f"{of // 10**9},{of % 10**9},{p},{b}" for of, p, b in zip(NANO, PULL, BEND, strict=True))
TWO = {"time_column": "stamp.sec", "time_fraction_column": "stamp.nanosec"}
NUMBERED = {"command_column": "2", "command_unit": "mm", "angle_column": "3", "angle_unit": "deg"}
READ = {
    "two columns of time": ("stamp.sec,stamp.nanosec,pull_mm,angle_deg\n" + SPLIT, MM | TWO),
    "nanoseconds": (
        "%time,pull_mm,angle_deg\n" + rows(NANO),
        MM | {"time_column": "%time", "time_unit": "ns"},
    ),
    "units in brackets": (
        "Time (ms),Pull [mm],Angle [deg]\n" + rows([f"{1e3 * second:.0f}" for second in TIME]),
        {"time_column": "Time (ms)", "command_column": "Pull [mm]", "angle_column": "Angle [deg]"},
    ),
    "dates": ("time_s,pull_mm,angle_deg\n" + rows(stamped(lambda of: of.isoformat(" "))), MM),
    "dates without a zone": (HEAD + rows(stamped(lambda of: of.replace(tzinfo=None).isoformat())), MM),
    "counts": (
        HEAD.replace("pull_mm", "counts") + rows(SECONDS, 120_000 + PULL * 1e5),
        {"command_column": "counts", "command_unit": "mm", "command_scale": 1e-5, "command_zero": 120_000},
    ),
    "wrapped": (HEAD + rows(SECONDS, bend=BEND % 360), MM | {"unwrap_angle": True}),
    "a title": ("Bench 3,,\nOperator:,pull_mm,\n\n" + HEAD + rows(SECONDS), MM),
    "no header": (rows(SECONDS), NUMBERED | {"no_header": True, "time_column": "1", "time_unit": "s"}),
    "separators behind": (HEAD + rows(SECONDS, end=",,"), MM),
    "decimal commas": (HEAD.replace(",", ";") + rows(SECONDS, mark=";").replace(".", ","), MM),
    "comments and units": (
        "# bent by 90 deg\ntime,pull,angle\ns,mm,deg\n# begins\n" + rows(SECONDS),
        {"time_column": "time", "command_column": "pull", "angle_column": "angle"},
    ),
}


@pytest.mark.parametrize("habit", READ)
def test_it_is_read_to_the_same_samples_without_a_word(tmp_path, habit):
    text, form = READ[habit]
    (tmp_path / "log.csv").write_text(text)
    log = read_measured_log(tmp_path / "log.csv", LogFormat(**form), on_warning=pytest.fail)
    np.testing.assert_allclose(log.time, TIME, atol=1e-6)
    np.testing.assert_allclose(log.pull_mm, PULL, atol=1e-9)
    np.testing.assert_allclose(log.truth_deg, BEND, atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8-sig", "cp1252"])
def test_any_common_encoding_is_read(tmp_path, encoding):
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    text = "time_s\tpull_mm\tWinkel [\xb0]\n" + rows(SECONDS, mark="\t")
    (tmp_path / "log.txt").write_bytes((mark + text).encode(encoding))
    log = read_measured_log(tmp_path / "log.txt", LogFormat(**MM, angle_column="Winkel [\xb0]"))
    np.testing.assert_allclose(log.truth_deg, BEND, atol=1e-9)


def spiked(values):
    values = values.copy()
    values[[70, 300]] -= 40
    return values


JITTER = TIME + 0.004 * np.sin(np.arange(COUNT))
DOUBTFUL = {
    "a wrapped angle": (
        rows(SECONDS, bend=BEND % 360),
        r" line \d+: angle_deg jumps by a turn, as in \d rows",
    ),
    "glitches": (rows(SECONDS, spiked(PULL)), "pull_mm jumps for one row in 2 places, lines 72, 302"),
    "jitter": (rows(JITTER), "time steps by 16.2 to 23.8 ms"),
    "a late command": (
        rows(SECONDS, [None] * 9 + [*PULL[9:]]),
        "line 2: pull_mm has not begun, as in 9 of 9",
    ),
}


@pytest.mark.parametrize("habit", DOUBTFUL)
def test_what_is_doubtful_is_named(tmp_path, habit):
    text, warning = DOUBTFUL[habit]
    (tmp_path / "log.csv").write_text(HEAD + text)
    said = []
    read_measured_log(tmp_path / "log.csv", LogFormat(**MM), on_warning=said.append)
    with pytest.raises(AssertionError, match=warning):
        raise AssertionError("\n".join(said))
    assert len(said) == 1


REFUSED = {
    "whole seconds": (rows(np.floor(TIME)), r"400 rows have 8 different times"),
    "angles without a time": (
        rows(
            *(
                [None if k % 2 == odd else of for k, of in enumerate(v)]
                for odd, v in ((0, TIME), (0, PULL), (1, BEND))
            )
        ),
        "time_s is missing, as in 200 of 400 rows: they hold 200 of 200 values of angle_deg",
    ),
    "a clock that begins again": (rows([*SECONDS[:250], *SECONDS[:150]]), "line 252: time_s begins again"),
    "no header": (rows(SECONDS), "line 1 holds numbers: the file has no header"),
}


@pytest.mark.parametrize("habit", REFUSED)
def test_what_cannot_be_read_is_refused(tmp_path, habit):
    text, fault = REFUSED[habit]
    (tmp_path / "log.csv").write_text(text if habit == "no header" else HEAD + text)
    with pytest.raises(ValueError, match=fault):
        read_measured_log(tmp_path / "log.csv", LogFormat(**MM))


@pytest.mark.parametrize("second", [0.0, 300.0])
def test_runs_of_one_file_are_split_where_the_clock_begins_again_or_pauses(tmp_path, second):
    time = np.where(np.arange(COUNT) < 250, TIME, TIME - TIME[250] + second)
    (tmp_path / "log.csv").write_text(HEAD + rows(time))
    logs = read_windows(tmp_path / "log.csv", None, LogFormat(**MM))
    assert [len(log.time) for log in logs] == [250, 150]
    np.testing.assert_allclose(np.concatenate([log.pull_mm for log in logs]), PULL, atol=1e-9)
    assert [log.time[0] for log in logs] == [0, 0]


def test_topics_that_are_joined_by_time_have_the_last_command_at_each_angle(tmp_path):
    lines = [(of, "", bend) for of, bend in zip(TIME, BEND, strict=True)]
    lines += [(of + 0.004, pull, "") for of, pull in zip(TIME, PULL, strict=True)]
    (tmp_path / "log.csv").write_text(HEAD + "".join(f"{a:.3f},{b},{c}\n" for a, b, c in sorted(lines)))
    log = read_measured_log(tmp_path / "log.csv", LogFormat(**MM))
    np.testing.assert_allclose(log.time, TIME[:-1], atol=1e-9)
    np.testing.assert_allclose(log.pull_mm, PULL[:-1], atol=1e-9)
    np.testing.assert_allclose(log.truth_deg, BEND[1:], atol=1e-9)


@pytest.mark.parametrize(
    "habit", [habit for habit in READ if habit not in ("counts", "no header", "wrapped")]
)
def test_a_look_guesses_how_a_log_is_read(tmp_path, habit):
    (tmp_path / "log.csv").write_text(READ[habit][0])
    guess = look(tmp_path / "log.csv")
    log = read_measured_log(tmp_path / "log.csv", guess.form(), on_warning=pytest.fail)
    np.testing.assert_allclose(log.time, TIME, atol=1e-6)
    np.testing.assert_allclose(log.truth_deg, BEND, atol=1e-9)
    assert all(f"{name}" in guess.command() for name in guess.roles.values())


def test_what_a_look_cannot_know_is_left_to_the_user(tmp_path):
    (tmp_path / "log.csv").write_text(READ["counts"][0])
    guess = look(tmp_path / "log.csv")
    assert guess.form() is None
    assert "--command-column counts --command-unit UNIT" in guess.command()
    assert "--command-scale UNITS_PER_COUNT --command-zero COUNTS_AT_ZERO" in guess.command()
    (tmp_path / "log.csv").write_text(READ["no header"][0])
    assert (
        "--no-header --time-column 1 --time-unit s --command-column COLUMN"
        in look(tmp_path / "log.csv").command()
    )


FAULTS = ["restart", "pause", "wrap", "ms", "metres", "radians", "stamps", "late", "no time", "spike"]


def damaged(rng):
    """Return a fault, and the text of a log that has it."""
    count = int(rng.integers(150, 600))
    step = float(rng.choice([0.005, 0.02, 1 / 30, 0.1]))
    time = np.arange(count) * step
    pull = 3 * np.sin(2 * np.pi * rng.uniform(0.1, 0.3) * time + rng.uniform(0, 6))
    bend = 9 * np.interp(time - 0.1, time, pull) + rng.normal(0, rng.choice([0.0, 0.1]), count)
    at, fault = int(rng.integers(count // 4, 3 * count // 4)), str(rng.choice(FAULTS))
    if fault == "restart":
        time[at:] -= time[at] - rng.uniform(0, 0.5 * time[at - 1])
    elif fault == "pause":
        time[at:] += rng.uniform(30 * step + 1, 500)
    elif fault == "wrap":
        bend = (bend - np.median(bend)) % 360
    elif fault == "ms":
        time *= 1e3
    elif fault == "metres":
        pull *= 1e-3
    elif fault == "radians":
        bend = np.radians(bend)
    elif fault == "stamps":
        time = np.floor(time / (20 * step)) * 20 * step
    elif fault == "late":
        time[at : at + 4] -= 10 * step
    elif fault == "no time":
        time[at : at + count // 5] = np.nan
    elif fault == "spike":
        pull[at] += rng.choice([-1, 1]) * rng.uniform(20, 100)
    lines = zip(time, pull, bend, strict=True)
    fields = (("" if np.isnan(of) else f"{of:.6f}" for of in line) for line in lines)
    return fault, HEAD + "\n".join(map(",".join, fields))


@pytest.mark.parametrize("count", [100, pytest.param(2000, marks=pytest.mark.slow)])
def test_no_fault_passes_without_a_word(tmp_path, count):
    rng = np.random.default_rng(count)
    silent = []
    for _ in range(count):
        fault, text = damaged(rng)
        (tmp_path / "log.csv").write_text(text)
        said = []
        try:
            said += oddities(read_measured_log(tmp_path / "log.csv", LogFormat(**MM), on_warning=said.append))
        except ValueError as error:
            said.append(str(error))
        silent += [] if said else [fault]
    assert not silent
