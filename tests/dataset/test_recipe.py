"""Recipes: which conditions each episode gets, what it depends on, and every digit comes back from a file."""

import hashlib
import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_dataset import RECIPE, SMALL, TWO_PLANES, changed, make

from twin.dataset.recipe import Recipe, of_each_episode, to_yaml
from twin.dataset.recipe_file import parse_recipe, resolve
from twin.preset.randomization import Ranges
from twin.rendering.camera import Camera
from twin.signals.excitation import SIGNALS

HERE = Path()


def test_signals_change_fastest_then_strokes_then_bends_and_all_begin_again():
    signals, strokes = ("sine", "triangle", "multi-sine"), ((-1.0, 1.0), (0.0, 2.0))
    bends = ((0.0, 0.0), (10.0, 90.0))
    recipe = changed(signals=signals, strokes_mm=strokes, sheath_bends_deg=bends)
    expected = list(itertools.product(bends, strokes, signals))
    found = [recipe.conditions(number) for number in range(2 * len(expected))]
    assert [(one.sheath_bend_deg, one.stroke_mm, one.signal) for one in found] == 2 * expected
    assert changed().conditions(3).sheath_bend_deg is None


PRINTABLE = st.characters(exclude_categories=("C", "Z"))
pulls_mm = st.floats(-8, 8)
angles = st.floats(0, 1440) | st.integers(0, 1440)


def rising(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[float, float]]:
    pair = st.tuples(numbers, numbers).map(lambda pair: (min(pair), max(pair)))
    return pair.filter(lambda pair: pair[1] - pair[0] > 1e-6)


@st.composite
def recipes(draw: st.DrawFn) -> Recipe:
    planes = draw(st.sampled_from([1, 2]))
    numbers = {
        "wire_stiffness": draw(st.floats(1e3, 1e6)),
        "joint_friction": draw(st.floats(0, 1e-3)),
        "gravity_z": draw(st.floats(-100, 100)),
    }
    given = draw(st.none() | st.lists(st.floats(-8e-3, 8e-3), min_size=2, max_size=30).map(tuple))
    sample_time = draw(st.integers(1, 5)) * 0.01
    name = draw(st.text(PRINTABLE, min_size=1, max_size=120))
    ranges = st.builds(Ranges, st.tuples(st.tuples(st.just("pretension"), st.floats(0, 3), st.floats(4, 9))))
    return Recipe(
        preset=SMALL.replace(name=name, bending_planes=planes, **numbers),
        strokes_mm=((round(min(given) * 1e3, 9), round(max(given) * 1e3, 9)),)
        if given
        else draw(st.lists(rising(pulls_mm), min_size=1, max_size=3).map(tuple)),
        lateral_stroke_mm=draw(st.none() | rising(pulls_mm)) if planes == 2 else None,
        sheath_bends_deg=draw(st.lists(st.tuples(angles, angles), max_size=3).map(tuple)),
        ranges=draw(st.none() | ranges),
        seconds=len(given) * sample_time if given else draw(st.floats(0.5, 2) | st.integers(1, 2)),
        sample_time_s=sample_time,
        signals=draw(st.lists(st.sampled_from(list(SIGNALS)), min_size=1).map(tuple)),
        sensor_variance_deg2=draw(st.floats(0, 1e6) | st.integers(0, 9)),
        camera=draw(st.none() | st.builds(Camera, st.floats(0.01, 1000), st.integers(40, 640).map(_twice))),
        episodes=draw(st.integers(1, 6000)),
        given_pull_m=given,
        seeds=draw(st.lists(st.integers(0, 2**70), min_size=1, max_size=3, unique=True).map(tuple)),
    )


def _twice(number: int) -> int:
    return 2 * number


@given(recipes())
def test_recipe_comes_back_from_its_file_with_every_digit(recipe):
    again = resolve(parse_recipe(to_yaml(recipe)), HERE)
    assert again == recipe
    assert of_each_episode.__wrapped__(again) == of_each_episode.__wrapped__(recipe)  # not from the cache


def test_what_an_episode_depends_on_leaves_out_how_many_there_are():
    text, sha256 = of_each_episode(RECIPE)
    assert sha256 == hashlib.sha256(text.encode()).hexdigest()
    assert of_each_episode(changed(episodes=9, seeds=(1, 2))) == (text, sha256)


@pytest.mark.parametrize(
    "change",
    [
        {"preset": SMALL.replace(pretension=3.0000000001)},
        {"strokes_mm": ((-1.0, 1.5),)},
        {"lateral_stroke_mm": (-1.0, 1.0)},
        {"sheath_bends_deg": ((0.0, 0.0),)},
        {"ranges": Ranges((("pretension", 1.0, 2.0),))},
        {"seconds": 2.0},
        {"sample_time_s": 0.01},
        {"signals": ("sine",)},
        {"sensor_variance_deg2": 0.0},
        {"camera": Camera()},
        {"given_pull_m": (0.0, 1e-3)},
        {"given_lateral_pull_m": (0.0, 1e-3)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_what_an_episode_depends_on_has_everything_else(change):
    assert of_each_episode(changed(**change)) != of_each_episode(RECIPE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"strokes_mm": ((1.0, 1.0),)}, r"stroke \[1, 1\] mm: the first must be below the second"),
        ({"strokes_mm": ()}, "strokes_mm: none is given"),
        ({"seconds": 0.0}, "at least two samples"),
        ({"seconds": np.nan}, "nan s of an episode: at most 100000"),
        ({"seconds": 9e4}, "4500000 samples of an episode: at most 1000000"),
        ({"seconds": 1e4, "episodes": 5000}, "samples of a dataset: at most 1000000000"),
        ({"sample_time_s": -0.02}, "sample time -0.02 s: must be positive"),
        ({"sensor_variance_deg2": -1.0}, r"variance of the sensor -1 deg\^2: must be from 0 to 1e\+09"),
        ({"sensor_variance_deg2": 1e300}, r"variance of the sensor 1e\+300 deg\^2: must be"),
        ({"signals": ("sinus",)}, "unknown signal 'sinus'; valid: sine"),
        ({"episodes": 10_001}, "episodes = 10001: must be from 1 to 10000"),
        ({"seeds": (-1,)}, "seed = -1: must be from 0"),
        ({"seeds": (1, 2, 1)}, r"seeds = \[1, 2, 1\]: one is given twice"),
        ({"strokes_mm": ((0.0, np.nan),)}, r"stroke \[0, nan\] mm: this endoscope is pulled by at most"),
        ({"strokes_mm": ((0.0, 90.0),)}, r"stroke \[0, 90\] mm: this endoscope is pulled by at most 76\.5"),
        ({"lateral_stroke_mm": (0.0, 1.0)}, "'small' has one bending plane, it needs two"),
        ({"preset": TWO_PLANES, "lateral_stroke_mm": (-90.0, 0.0)}, r"stroke \[-90, 0\] mm: this endoscope"),
        ({"sheath_bends_deg": ((0.0, -6.0),)}, r"bend of the sheath -6 deg: must be from 0 to 1440 deg"),
        ({"camera": Camera(width=81)}, "81 x 240 pixels: must be even"),
        ({"given_pull_m": (0.0, 1e-3), "seconds": 2.0}, "2 s: the given command lasts 0.04 s"),
        (
            {"ranges": Ranges((("sheath_bend", 1.0, 2.0),)), "sheath_bends_deg": ((0.0, 0.0),)},
            "sheath_bends_deg and a range of sheath_bend: choose one",
        ),
    ],
)
def test_recipe_that_cannot_be_made_is_refused_before_any_work_in_one_line(tmp_path, change, message):
    with pytest.raises(ValueError, match=rf"^[^\n]*{message}[^\n]*$"):
        make(tmp_path / "data", changed(**change))
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(("episodes", "met"), [(1, 1), (3, 3), (4, None)])
def test_episodes_that_do_not_meet_every_stroke_and_bend_are_named(episodes, met):
    bends = ((0.0, 0.0), (90.0, 90.0))
    recipe = changed(
        signals=("sine",), strokes_mm=((-1.0, 1.0), (0.0, 1.0)), sheath_bends_deg=bends, episodes=episodes
    )
    count = f"{episodes} episode{'s' * (episodes > 1)}"
    line = f"{count} of each seed meet only {met} of 4 pairs of stroke and bend; for all, take 4"
    assert recipe.unmet == (line if met else None)
