"""A preset is matched to what is published of an instrument."""

import numpy as np
import pytest
from calibrating import TRUTH

from twin.calibration.circle import out_of_round
from twin.calibration.matching import ROUND, match
from twin.calibration.priors import Prior
from twin.calibration.published import Commands, Published, outcomes

STROKES = ((2e-3, 4e-3), (-1e-3, 1e-3))
ROW = ("gaussian", 1.0)
PRIORS = {
    "section_stiffness": Prior(TRUTH.section_stiffness, 0.5, (5e-3, 0.2)),
    "sheath_friction_floor": Prior(0.7, 0.5, (0.1, 5.0)),
    "joint_friction_taper": Prior(0.3, 0.2, (0.0, 0.8)),
}


def test_preset_is_matched_to_the_figures_of_another_endoscope():
    commands = Commands.drawn([1, 2], strokes=STROKES, episodes=(3, 2), seconds=15.0)
    wanted = TRUTH.replace(section_stiffness=1.4 * TRUTH.section_stiffness, sheath_friction_floor=1.0)
    its = outcomes([wanted], commands, [ROW])[0]
    published = Published(
        model=tuple(np.median(its.model, axis=0)),
        active={ROW: (float(its.active.mean()), 0.15)},
        static=(0.0, 90.0),
        misfit=90.0,
        steady=90.0,
    )
    reports = []
    start = TRUTH.replace(sheath_friction_floor=0.7)
    preset, outcome, cost = match(
        start, PRIORS, published, commands, on_outcome=lambda *news: reports.append(news)
    )
    first, costs = reports[0][1], [news[2] for news in reports]
    off = [np.abs(np.log(np.median(o.model, axis=0) / published.model)).max() for o in (first, outcome)]
    assert off[1] < min(0.01, off[0] / 5)
    assert preset.section_stiffness / wanted.section_stiffness == np.clip(
        preset.section_stiffness / wanted.section_stiffness, 0.8, 1.25
    )
    assert costs == sorted(costs, reverse=True)
    assert cost <= costs[0]


def test_limits_count_only_where_they_are_passed():
    commands = Commands.drawn([1], strokes=STROKES, episodes=(2, 2), seconds=10.0)
    its = outcomes([TRUTH], commands, [ROW])[0]
    model, active = tuple(its.model[0]), {ROW: (float(its.active[0, 0]), 0.15)}

    def cost(**limits):
        values = {"static": (0.0, 90.0), "misfit": 90.0, "steady": 90.0} | limits
        return match(TRUTH, PRIORS, Published(model, active, **values), commands, steps=1)[2]

    least = cost()
    assert cost(misfit=float(its.misfit[0]) + 0.01) == least
    for limits in (
        {"misfit": float(its.misfit[0]) - 0.1},
        {"steady": float(its.steady[0]) - 0.1},
        {"static": (0.0, float(its.static[0]) - 0.1)},
        {"static": (float(its.static[0]) + 0.1, 90.0)},
    ):
        assert cost(**limits) > least + 1


def test_circle_that_is_asked_for_counts_where_it_is_not_round():
    commands = Commands.drawn([1], strokes=STROKES, episodes=(2, 2), seconds=10.0)
    its = outcomes([TRUTH], commands, [ROW])[0]
    known = tuple(its.model[0]), {ROW: (float(its.active[0, 0]), 0.15)}, (0.0, 90.0), 90.0, 90.0
    share = float(out_of_round([TRUTH], [2e-3])[0, 0])
    plain, met, missed = (
        match(TRUTH, PRIORS, Published(*known, limit), commands, radii=(2e-3,), steps=1)[2]
        for limit in (np.inf, share * 1.01, share - 2 * ROUND)
    )
    assert met == plain
    assert missed == pytest.approx(plain + 4, rel=1e-3)
