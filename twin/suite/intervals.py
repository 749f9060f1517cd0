"""Containment: how often the intervals of set-membership filters hold the truth under bounded noise."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twin.estimation.set_membership import SetMembershipFilter
from twin.evaluation.case import group_records, make_case
from twin.evaluation.protocol import RECORDED, STEADY_SECONDS, Protocol
from twin.evaluation.record import EvaluationRecord
from twin.signals.noise import noise_bound


def containment(
    records: Sequence[EvaluationRecord], filters: Mapping[str, SetMembershipFilter], protocol: Protocol
) -> list[dict[str, Any]]:
    """Return how often the truth is inside, for each group of records, bounded noise and filter.

    Args:
        records: the test set, at the protocol's sample time.
        filters: by their names in the tables.
        protocol: noises, seeds and initial error.

    Returns:
        Rows with `runs_contained` and `samples_contained`, shares of those in which the truth is known, and
        the mean `width_deg` after the first 5 s, where there is such a time.
    """
    drawn = [condition for condition in protocol.conditions if condition[0] != RECORDED]
    bounded = [condition for condition in drawn if np.isfinite(noise_bound(*condition))]
    late = round(STEADY_SECONDS / protocol.sample_time_s)
    rows = []
    for group, condition in itertools.product(group_records(records), bounded):
        case = make_case(group, protocol, [condition])
        assert case.truth_deg is not None
        known = ~np.isnan(case.measurement_deg)
        begin = late if known[:, late:].any() else 0  # a short record has no time after the start
        for name, filter_ in filters.items():
            told = filter_.with_sensor(case.sensor)
            low, high = told.intervals(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
            inside = ((low <= case.truth_deg) & (case.truth_deg <= high)) | ~known
            rows.append(
                {
                    "method": name,
                    "noise": condition[0],
                    "level": condition[1],
                    "sample_time_s": protocol.sample_time_s,
                    "stroke_mm": list(group[0][1].stroke_mm),
                    "twin": group[0][1].twin,
                    "runs_contained": float(inside.all(axis=1).mean()),
                    "samples_contained": float(inside[known].mean()),
                    "width_deg": float((high - low)[:, begin:][known[:, begin:]].mean()),
                }
            )
    return rows
