"""The measurements by name: what is refused before any work, what is measured, and the table."""

import pytest

from scripts.benchmarks import measurements
from scripts.benchmarks.harness import Result
from scripts.benchmarks.measurements import MEASUREMENTS, Size, check_measurements, measure, results_table


@pytest.mark.parametrize(
    "field", ["amplitude", "cycles", "draws", "known", "steps", "episodes", "many_episodes", "frames"]
)
def test_a_size_that_measures_nothing_is_refused_by_name(field):
    with pytest.raises(ValueError, match=f"^{field} = 0: must be positive$"):
        Size(**{field: 0})


def test_an_unknown_measurement_is_refused_with_the_valid_ones():
    with pytest.raises(
        ValueError, match=r"^unknown measurement 'speed'; valid: rate_independence, .*memory$"
    ):
        check_measurements(Size(), ["hold", "speed"])
    check_measurements(Size(), list(MEASUREMENTS))


def test_each_is_measured_once_with_its_size_and_tells_how_far_it_is(monkeypatch):
    said = []
    one = Result("one", 1.0, "s", "below 2 s", peer="another", peer_value=2.0)
    two = Result("two", 3.0, "s", "below 2 s", holds=False)

    def several(preset, size, progress):
        progress(1, size.cycles)
        return {"a": one, "b": two}

    monkeypatch.setitem(measurements.MEASUREMENTS, "several", several)
    results = measure(
        Size(cycles=7), ["several"], lambda name: lambda *numbers: said.append((name, *numbers))
    )
    assert results == {"a": one, "b": two}
    assert said == [("several", 1, 7)]
    rows = results_table("short", results).splitlines()
    assert rows[0] == "Preset `short`, by `endotwin benchmark`."
    assert [cell.strip() for cell in rows[4].split("|")[1:-1]] == [
        "one",
        "1 s",
        "0.5 times another",
        "below 2 s",
        "yes",
    ]
    assert rows[5].split("|")[-2].strip() == "no"
