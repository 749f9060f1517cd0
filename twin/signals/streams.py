"""Streams of random numbers: all that one seed is used for, each use with numbers of its own."""

import enum

import numpy as np


class SeedUse(enum.IntEnum):
    """Use of a seed; its number follows the seed in the entropy of a generator.

    NumPy pads this entropy with zeros (O'Neill's mixing, four words at least): `[1, 1]` and
    `[1, 1, 0]` begin the same stream. Two uses must therefore differ here, not in how many numbers follow.
    """

    BENCHMARK_COMMANDS = 0
    BENCHMARK_TWINS = 1
    BENCHMARK_MEMBERS = 2
    BENCHMARK_WIDE_TWINS = 3
    SEALED_CONDITIONS = 4
    SEALED_NOISE = 5
    SEALED_HISTORIES = 6
    TWINS_MEMBERS = 100
    TWINS_COMMANDS = 101
    TWINS_TRUTHS = 102
    TWINS_SHEATHS = 103
    TWINS_BEGINS = 104
    TWINS_CHOICE = 105
    TWINS_CHOICE_COMMANDS = 106
    TWINS_HISTORIES = 107
    TWINS_KNOCKS = 108
    LESSON_LAWS = 200
    LESSON_GAIN = 201
    LESSON_INTERVAL = 202
    LESSON_VALIDATION = 203
    LESSON_FAMILIARITY = 204
    LESSON_EXPLORING = 205
    NOMINAL_RECORDS = 210
    FILTER_TUNING = 310
    LIKELIHOOD_SEARCH = 311
    TUNING_TWINS = 312
    PARTICLES = 313
    NETWORK = 320
    CONTROL_TWINS = 500
    CONTROL_REFERENCES = 501
    CONTROL_NOISE = 502
    CONTROL_TUNING_TWINS = 503
    CONTROL_TUNING_REFERENCES = 504
    CONTROL_TUNING_NOISE = 505
    VIEW_NOISE = 506
    CONTROL_SEALED = 507


def random_stream(seed: int, stream: SeedUse, *numbers: int) -> np.random.Generator:
    """Return the random numbers of one use of a seed; `numbers` say which of several of that use."""
    return np.random.default_rng([seed, stream, *numbers])
