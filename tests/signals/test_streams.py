"""Streams of random numbers: no two uses of a seed share any, however many numbers tell them apart."""

import itertools
import re
from pathlib import Path

import numpy as np

import rl
import twin
from twin.signals.streams import SeedUse, random_stream


def test_no_two_uses_of_a_seed_begin_the_same_stream():
    """Zeros behind what tells a use change nothing, as NumPy adds them itself: the use alone must differ."""
    assert random_stream(1, SeedUse.RANKS).random() == random_stream(1, SeedUse.RANKS, 0).random()
    begins = {
        (stream, numbers): random_stream(seed, stream, *numbers).integers(2**63)
        for seed in (0, 1)
        for stream in SeedUse
        for numbers in itertools.product((0, 1, 2), repeat=3)
    }
    assert len(set(begins.values())) == len(begins)


def test_draws_of_the_noise_are_of_no_other_use():
    """They begin from five numbers, the last of which is the level of the noise and never zero."""
    noise = {
        np.random.default_rng([1, draw, record, kind, 100]).integers(2**63)
        for draw, record, kind in itertools.product((*range(3), *SeedUse), range(2), range(2))
    }
    others = {
        random_stream(1, stream, *numbers).integers(2**63)
        for stream in SeedUse
        for numbers in itertools.product((0, 1), repeat=3)
    }
    assert not noise & others


def test_uses_are_named_in_one_place():
    """Nothing else in the packages puts a number of its own behind a seed that others use too."""
    own = re.compile(r"default_rng\(\[(self\.|settings\.|training\.|protocol\.)?seed, (_[A-Z]|\d)")
    found = [
        f"{path.name}: {line.strip()}"
        for package in (twin, rl)
        for path in Path(package.__file__).parent.rglob("*.py")
        for line in path.read_text().splitlines()
        if own.search(line)
    ]
    assert not found
