"""Domain randomisation: what is drawn follows its distribution, and no range leaves the endoscopes."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from presets import COUNTS, NUMBERS, PERIODS, write

from twin.preset.file import load_preset, preset_names, read_preset_file
from twin.preset.preset import Preset, parameter_limits
from twin.preset.randomization import Ranges, load_ranges

PRESET = Preset("nominal")
REALS = sorted(set(NUMBERS) - set(COUNTS) - PERIODS)
DRAWS = 1500


def draw_many(*limits: tuple[str, float, float], seed: int = 0) -> np.ndarray:
    """(draws, parameters)."""
    rng, ranges = np.random.default_rng(seed), Ranges(limits)
    drawn = [ranges.draw(PRESET, rng) for _ in range(DRAWS)]
    return np.array([[getattr(preset, name) for name, _, _ in limits] for preset in drawn])


def limits_within_those_of(name: str) -> st.SearchStrategy[tuple[str, float, float]]:
    pair = st.lists(st.floats(*parameter_limits(name)), min_size=2, max_size=2, unique=True)
    return pair.map(lambda ends: (name, *sorted(ends)))


def test_a_share_of_a_range_is_the_quantile_of_what_is_drawn():
    limits = ("pretension", 5.0, 8.0), ("sheath_friction", 0.02, 0.08)  # uniform, log-uniform
    ranges = Ranges(limits)
    drawn = draw_many(*limits)
    for share, rank in ((0.0, 0), (0.25, DRAWS // 4), (0.5, DRAWS // 2), (1.0, DRAWS - 1)):
        preset = ranges.at(PRESET, np.full(2, share))
        for (name, low, high), values in zip(limits, drawn.T, strict=True):
            assert getattr(preset, name) == pytest.approx(sorted(values)[rank], abs=0.05 * (high - low))


@given(data=st.data(), names=st.sets(st.sampled_from(REALS), min_size=1, max_size=5), seed=st.integers(0, 99))
def test_drawn_parameters_lie_in_their_ranges_and_no_other_changes(data, names, seed):
    ranges = Ranges(tuple(data.draw(limits_within_those_of(name)) for name in sorted(names)))
    preset = ranges.draw(PRESET, np.random.default_rng(seed))
    for name, low, high in ranges.limits:
        drawn = getattr(preset, name)
        assert low <= drawn <= high or drawn == pytest.approx(low, rel=1e-12)  # exp(log(low)) rounds
    assert preset.replace(**{name: getattr(PRESET, name) for name in names}) == PRESET


def test_ranges_come_back_from_yaml_to_the_last_digit(tmp_path):
    ranges = Ranges((("wire_stiffness", 1e4 / 3, 2e4), ("gravity_z", -9.81, 1e-7)))
    text = yaml.safe_dump({"ranges": ranges.to_dict()}, sort_keys=False)
    assert load_ranges(write(tmp_path, text)) == ranges
    text = "ranges: {wire_stiffness: [1e4, 2e4]}"  # YAML 1.1 reads these as text
    assert load_ranges(write(tmp_path, text)) == Ranges((("wire_stiffness", 1e4, 2e4),))


@pytest.mark.parametrize("name", [n for n in preset_names() if "ranges" in read_preset_file(n)[1]])
def test_shipped_ranges_lie_around_their_preset_and_give_endoscopes(name):
    preset, ranges = load_preset(name), load_ranges(name)
    assert all(low <= getattr(preset, parameter) <= high for parameter, low, high in ranges.limits)
    rng = np.random.default_rng(0)
    assert len({ranges.draw(preset, rng) for _ in range(100)}) == 100


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ("{wire_stifness: [1e4, 2e4]}", r"unknown preset parameter 'wire_stifness' \(did you mean"),
        ("{7: [1, 2]}", "unknown preset parameter '7'; valid: bending_planes"),
        ("{pretension: [4, 2]}", r"range of pretension = \[4, 2\]: must rise, within \[0, 500\]"),
        ("{pretension: [1, 501]}", r"range of pretension = \[1, 501\]: must rise, within \[0, 500\]"),
        ("{pretension: [.nan, 2]}", r"range of pretension = \[nan, 2\]: must rise"),
        ("{pretension: 3}", r"range of pretension = 3: must be \[low, high\]"),
        ("{pretension: [low, high]}", r"range of pretension = \['low', 'high'\]: must be \[low, high\]"),
        ("{vertebrae: [8, 16]}", "range of vertebrae: it is not drawn"),
        ("{}", "mine.yaml states no ranges: add `ranges:` with"),
        ("", "mine.yaml states no ranges"),
    ],
)
def test_ranges_that_hold_no_endoscope_are_refused_in_one_line(tmp_path, ranges, message):
    with pytest.raises(ValueError, match=message) as refused:
        load_ranges(write(tmp_path, f"pretension: 5\nranges: {ranges}"))
    assert "\n" not in str(refused.value)


@given(factor=st.floats(0.1, 3))
def test_wider_ranges_have_the_same_middles_where_nothing_limits_them(factor):
    preset, ranges = load_preset("ureteroscope"), load_ranges("ureteroscope")
    for (name, low, high), (_, least, most) in zip(ranges.limits, ranges.wider(factor).limits, strict=True):
        preset.replace(**{name: least})
        preset.replace(**{name: most})
        if factor <= 1:
            assert low <= least * (1 + 1e-9) + 1e-12
            assert most <= high * (1 + 1e-9)
        elif name in ("pretension", "wire_offset", "wire_stiffness"):
            assert (most - least) / (high - low) == pytest.approx(factor)
            assert least + most == pytest.approx(low + high)
