"""Plausible limits of angles, pulls and times: a value beyond them is a mistake, whoever sends it.

A log that is read holds to them, as does a live stream. They are wide on purpose: they tell a broken packet
or another unit from an endoscope, not a good endoscope from a bad one.
"""

LARGEST_BEND_DEG = 720.0
"""Magnitude of a bending angle, two full turns: no section bends so far [deg]."""

LARGEST_PULL_MM = 200.0
"""Magnitude of a pulling distance, ten times the stroke of a long section [mm]."""

LARGEST_TIME_S = 9.2e9
"""Magnitude of a time stamp, 292 years: nanoseconds since 1970 end there too [s]."""
