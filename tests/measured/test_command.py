import numpy as np
import pytest

from twin.measured.command import CommandFormat, read_command
from twin.measured.table import SECONDS_PER_CYCLE
from twin.preset.file import load_preset


@pytest.fixture(scope="module")
def preset():
    return load_preset("ureteroscope").replace(pulley_radius=0.02)


def write(path, text):
    path.write_text(text)
    return path


def test_pull_over_time_is_taken_as_it_is(tmp_path, preset):
    path = write(tmp_path / "c.csv", "time_s,pull_mm\n0,0\n1,2\n2,1\n")
    pull = read_command(path, preset, 0.5)[0]
    np.testing.assert_allclose(pull, [0, 1e-3, 2e-3, 1.5e-3])


def test_angle_over_phase_becomes_a_pull_at_the_stated_rate(tmp_path, preset):
    phase = np.linspace(0, 2 * np.pi, 401)
    lines = [f"{p},{60 * np.sin(p)},1" for p in phase]
    path = write(tmp_path / "c.csv", "phase_rad,command_deg,angle_deg\n" + "\n".join(lines))
    pull = read_command(path, preset, 0.1)[0]
    assert len(pull) == SECONDS_PER_CYCLE / 0.1
    assert pull.max() == pytest.approx(np.radians(60) * 0.02, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,pull_mm\n0,0\n1,nan\n", "line 3: pull_mm is missing"),
        ("time_s,pull_mm\n0,0\n1,\n", "line 3: pull_mm is missing"),
        ("time_s,pull_mm\n0,0\n1,abc\n", "line 3: pull_mm is 'abc'"),
        ("time_s,pull_mm\n0,0\n2,1\n1,1\n", "line 4: time_s runs backwards"),
        ("time_s,angle\n0,0\n", "no column pull_mm or command_deg; its columns: time_s, angle"),
        ("pull_mm\n1\n", "no column time_s or phase_rad"),
        ("time_s,pull_mm\n", "holds no lines"),
        ("time_s,pull_mm\n0,1\n0.001,2\n", "less than one sample"),
        (
            "time_s,pull_mm\n0,1\n1e6,2\n",
            "lasts 1e\\+06 s, at most 100000 s are simulated: check `time_unit`",
        ),
        (
            "time_s,pull_mm\n0,1\n1,2000\n",
            "line 3: pull_mm is 2000 mm of .* check `command_unit`; counts of an encoder need `import ",
        ),
    ],
)
def test_a_file_that_is_no_command_is_refused(tmp_path, preset, text, message):
    path = write(tmp_path / "c.csv", text)
    with pytest.raises(ValueError, match=message):
        read_command(path, preset, 0.02)


def test_columns_are_those_that_are_named_in_their_units(tmp_path, preset):
    path = write(
        tmp_path / "c.csv", "pull_mm,clock,knob_rad,other,stamp_s\n9,0,0,1,5\n9,500,0.1,3,5\n9,1000,0.2,5,6\n"
    )
    form = CommandFormat(
        command_column="knob_rad", time_column="clock", time_unit="ms", lateral_command_column="knob_rad"
    )
    pull, lateral = read_command(path, preset, 0.5, form)
    np.testing.assert_allclose(pull, [0, 2e-3])
    np.testing.assert_allclose(lateral, pull)
    metres = CommandFormat(command_column="other", command_unit="mm", time_column="stamp_s")
    pull, lateral = read_command(path, preset, 0.5, metres)
    np.testing.assert_allclose(pull, [2e-3, 3.5e-3])
    assert lateral is None
