"""Mistakes in the call of the full benchmark: one line each, before any work."""

import pytest

from scripts.evaluate import main


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("--policy p.onnx", "no trained file p.onnx"),
        ("--sample-time 0.03", "--sample-time 0.03 s: must be a multiple of 0.02 s"),
        ("--members 3", "--members 3: must be from 8 to 10000"),
        ("--ensembles 0", "--ensembles 0: must be from 1 to 100"),
        ("--episodes 0", "--episodes 0"),
        ("--trainings 0", "--trainings 0: must be from 1 to 100"),
        ("--preset none", "none"),
        ("--seeds 0", "--seeds 0"),
        ("--seconds 2", "--seconds 2: must be from 5 to 100000 s"),
        ("nowhere", "nowhere"),
    ],
)
def test_a_mistake_is_one_line_before_any_work(flags, message, tmp_path, capsys):
    assert main(["--suite", "full", "--out", str(tmp_path / "out"), *flags.split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.glob("out/*"))
