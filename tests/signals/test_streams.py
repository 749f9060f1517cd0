"""Streams of random numbers: no two uses of a seed share any, however many numbers tell them apart."""

import itertools

from twin.signals.streams import SeedUse, random_stream


def test_no_two_uses_of_a_seed_begin_the_same_stream():
    """Zeros behind what tells a use change nothing, as NumPy adds them itself: the use alone must differ."""
    assert random_stream(1, SeedUse.NETWORK).random() == random_stream(1, SeedUse.NETWORK, 0).random()
    begins = {
        (stream, numbers): random_stream(seed, stream, *numbers).integers(2**63)
        for seed in (0, 1)
        for stream in SeedUse
        for numbers in itertools.product((0, 1, 2), repeat=3)
    }
    assert len(set(begins.values())) == len(begins)
