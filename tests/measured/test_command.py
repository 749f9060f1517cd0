import numpy as np
import pytest

from twin.measured.command import SECONDS_PER_CYCLE, read_command
from twin.preset.file import load_preset


@pytest.fixture(scope="module")
def preset():
    return load_preset("ureteroscope").replace(pulley_radius=0.02)


def write(path, text):
    path.write_text(text)
    return path


def test_pull_over_time_is_taken_as_it_is(tmp_path, preset):
    path = write(tmp_path / "c.csv", "time_s,pull_mm\n0,0\n1,2\n2,1\n")
    pull = read_command(path, preset, 0.5)
    np.testing.assert_allclose(pull, [0, 1e-3, 2e-3, 1.5e-3])


def test_angle_over_phase_becomes_a_pull_at_the_stated_rate(tmp_path, preset):
    phase = np.linspace(0, 2 * np.pi, 401)
    lines = [f"{p},{60 * np.sin(p)},1" for p in phase]
    path = write(tmp_path / "c.csv", "phase_rad,command_deg,angle_deg\n" + "\n".join(lines))
    pull = read_command(path, preset, 0.1)
    assert len(pull) == SECONDS_PER_CYCLE / 0.1
    assert pull.max() == pytest.approx(np.radians(60) * 0.02, rel=1e-3)


def test_samples_at_one_time_are_averaged(tmp_path, preset):
    path = write(tmp_path / "c.csv", "time_s,pull_mm\n0,0\n0,2\n1,1\n")
    np.testing.assert_allclose(read_command(path, preset, 0.5), [1e-3, 1e-3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,pull_mm\n0,0\n1,nan\n", "line 3: pull_mm is 'nan'"),
        ("time_s,pull_mm\n0,0\n1,\n", "line 3: pull_mm is ''"),
        ("time_s,pull_mm\n0,0\n1,abc\n", "line 3: pull_mm is 'abc'"),
        ("time_s,pull_mm\n0,0\n2,1\n1,1\n", "line 4: time_s runs backwards"),
        ("time_s,angle\n0,0\n", "no column pull_mm or command_deg; its columns: time_s, angle"),
        ("pull_mm\n1\n", "no column time_s or phase_rad"),
        ("time_s,pull_mm\n", "holds no lines"),
        ("time_s,pull_mm\n0,1\n0.001,2\n", "less than one sample"),
    ],
)
def test_a_file_that_is_no_command_is_refused(tmp_path, preset, text, message):
    path = write(tmp_path / "c.csv", text)
    with pytest.raises(ValueError, match=message):
        read_command(path, preset, 0.02)


def test_a_missing_or_binary_file_is_refused(tmp_path, preset):
    with pytest.raises(FileNotFoundError, match="no command file"):
        read_command(tmp_path / "none.csv", preset, 0.02)
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ValueError, match="is not a CSV file"):
        read_command(tmp_path / "b.csv", preset, 0.02)
