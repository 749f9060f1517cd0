"""Recipes: which conditions each episode gets, what it depends on, and every digit comes back from a file."""

import dataclasses
import hashlib
import itertools
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_dataset import RECIPE, SMALL, changed

from twin.dataset.recipe import EpisodeKey, Recipe, of_each_episode, to_yaml
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


def test_every_seed_has_the_same_number_of_episodes_in_order():
    recipe = changed(seeds=(7, 3), episodes=2)
    assert recipe.keys == [EpisodeKey(7, 0), EpisodeKey(7, 1), EpisodeKey(3, 0), EpisodeKey(3, 1)]


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
    name = draw(st.text(PRINTABLE, min_size=1, max_size=120))
    ranges = st.builds(Ranges, st.tuples(st.tuples(st.just("pretension"), st.floats(0, 3), st.floats(4, 9))))
    return Recipe(
        preset=SMALL.replace(name=name, bending_planes=planes, **numbers),
        strokes_mm=draw(st.lists(rising(pulls_mm), min_size=1, max_size=3).map(tuple)),
        lateral_stroke_mm=draw(st.none() | rising(pulls_mm)) if planes == 2 else None,
        sheath_bends_deg=draw(st.lists(st.tuples(angles, angles), max_size=3).map(tuple)),
        ranges=draw(st.none() | ranges),
        seconds=draw(st.floats(0.5, 2) | st.integers(1, 2)),
        sample_time_s=draw(st.integers(1, 5)) * 0.01,
        signals=draw(st.lists(st.sampled_from(list(SIGNALS)), min_size=1).map(tuple)),
        sensor_variance_deg2=draw(st.floats(0, 1e6) | st.integers(0, 9)),
        camera=draw(st.none() | st.builds(Camera, st.floats(0.01, 1000), st.integers(40, 640).map(_twice))),
        episodes=draw(st.integers(1, 6000)),
        seeds=draw(st.lists(st.integers(0, 2**70), min_size=1, max_size=3, unique=True).map(tuple)),
    )


def _twice(number: int) -> int:
    return 2 * number


@given(recipes())
def test_recipe_comes_back_from_its_file_with_every_digit(recipe):
    again = resolve(parse_recipe(to_yaml(recipe)), HERE)
    assert again == recipe
    assert of_each_episode.__wrapped__(again) == of_each_episode.__wrapped__(recipe)  # not from the cache


@given(st.lists(st.floats(-8e-3, 8e-3), min_size=2, max_size=30), st.integers(1, 5))
def test_given_command_comes_back_with_every_digit(pull, periods):
    values = {"preset": SMALL.to_dict(), "given_pull_m": pull, "sample_time_s": 0.01 * periods}
    recipe = resolve(values, HERE)
    assert recipe.given_pull_m == tuple(pull)
    again = resolve(parse_recipe(to_yaml(recipe)), HERE)
    assert again == recipe
    assert of_each_episode.__wrapped__(again) == of_each_episode.__wrapped__(recipe)


def test_whole_numbers_make_the_recipe_that_they_are_as_decimals():
    whole = Recipe(SMALL, ((-1, 1),), sheath_bends_deg=((0, 90),), seconds=2, sensor_variance_deg2=1)
    decimal = Recipe(SMALL, ((-1.0, 1.0),), sheath_bends_deg=((0.0, 90.0),), seconds=2.0)
    decimal = dataclasses.replace(decimal, sensor_variance_deg2=1.0)
    assert to_yaml.__wrapped__(whole) == to_yaml.__wrapped__(decimal)


def test_recipe_of_whole_numbers_is_the_same_as_of_decimals():
    whole, decimal = (changed(preset=SMALL.replace(pretension=value)) for value in (4, 4.0))
    assert of_each_episode.__wrapped__(whole) == of_each_episode.__wrapped__(decimal)
    assert SMALL.replace(bending_planes=2).to_dict()["bending_planes"] == 2
    ranges = [Ranges((("pretension", low, high),)) for low, high in ((1, 6), (1.0, 6.0))]
    cameras = [Camera(rate) for rate in (10, 10.0)]
    one, other = (
        changed(ranges=range_, camera=camera) for range_, camera in zip(ranges, cameras, strict=True)
    )
    assert to_yaml.__wrapped__(one) == to_yaml.__wrapped__(other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"episodes": 10_001}, "episodes = 10001: must be from 1 to 10000"),
        ({"given_pull_m": (0.0, 1e-3), "seconds": 2.0}, "2 s: the given command lasts 0.04 s"),
        (
            {"ranges": Ranges((("sheath_bend", 1.0, 2.0),)), "sheath_bends_deg": ((0.0, 0.0),)},
            "sheath_bends_deg and a range of sheath_bend: choose one",
        ),
    ],
)
def test_recipe_that_contradicts_itself_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        changed(**change).check()


def test_what_an_episode_depends_on_does_not_tell_how_many_there_are():
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
def test_what_an_episode_depends_on_tells_everything_else(change):
    assert of_each_episode(changed(**change)) != of_each_episode(RECIPE)
