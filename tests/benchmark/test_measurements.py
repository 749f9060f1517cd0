"""The measurements by name: what is refused before any work, what is measured, and the table."""

import pytest

import scripts.benchmark
from scripts.benchmarks.harness import MEASUREMENTS, Result, measure, results_table


@pytest.mark.parametrize("word", ["amplitude", "cycles", "draws", "known"])
def test_a_size_that_measures_nothing_is_refused_by_name(word, tmp_path, capsys):
    flag = f"--{word}"
    assert scripts.benchmark.main([flag, "0", "--out", str(tmp_path / "x.json")]) == 2
    assert f"{flag} 0" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_an_unknown_measurement_is_refused_with_the_valid_ones(tmp_path, capsys):
    assert scripts.benchmark.main(["--only", "speed", "--out", str(tmp_path / "new/x.json")]) == 2
    assert "unknown measurement 'speed'; valid: " in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_each_is_measured_once_with_its_options(monkeypatch):
    shown = []
    one = Result("one", 1.0, "s", "< 0.6 times another", peer="another", peer_value=2.0)
    two = Result("two", 3.0, "s", "<= 2 s")

    def several(cycles, progress):
        progress(1, cycles)
        return {"a": one, "b": two}

    monkeypatch.setitem(MEASUREMENTS, "several", several)
    progress = lambda name: lambda *numbers: shown.append((name, *numbers))  # noqa: E731
    results = measure(("several",), progress, preset="ureteroscope", cycles=7, draws=3)
    assert results == {"a": one, "b": two}
    assert shown == [("several", 1, 7)]
    rows = [row.split("|")[1:-1] for row in results_table("short", results).splitlines()[4:6]]
    shown = [cell.strip() for cell in rows[0]]
    assert shown == ["one", "1 s", "0.5 times another", "< 0.6 times another", "yes"]
    assert rows[1][-1].strip() == "no"


@pytest.mark.parametrize(
    ("bar", "holds"),
    [("< 1 s", False), ("<= 1 s", True), (">= 2 times it", True), ("< 2 times it", False), ("", True)],
)
def test_a_bar_is_of_the_value_or_of_its_ratio(bar, holds):
    assert Result("x", 1.0, "s", bar, peer="it", peer_value=0.5).holds is holds
    assert not Result("x", 1.0, "s", bar, kept=False).holds
