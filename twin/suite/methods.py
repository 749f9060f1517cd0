"""Every method of the full benchmark that has no network, under its name in the tables."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import AdaptiveActiveModel
from twin.estimation.bias import BiasedActiveModel
from twin.estimation.constant_gain import ConstantGain
from twin.estimation.error_bound import bound_model_error, geometric_error_bound
from twin.estimation.kalman import KalmanActiveModel
from twin.estimation.open_loop import OpenLoop
from twin.estimation.robust import RobustActiveModel
from twin.estimation.set_membership import SetMembershipFilter
from twin.estimation.tuning import UntoldActiveModel
from twin.estimation.unscented import UnscentedActiveModel
from twin.evaluation.method import Method, as_method
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii
from twin.suite.fitting import MONOTONE, TUNED_WITH, Fits, tuned_koopman

Array = NDArray[np.float64]


def static_methods(fits: Fits) -> list[Method]:
    """Models alone, from the wrong initial estimate."""
    names = {
        "C-H": ColemanHodgdon.name,
        "C-H (monotone)": MONOTONE,
        "Bouc-Wen": BoucWen.name,
        "P-I": PrandtlIshlinskii.name,
    }
    return [as_method(name, OpenLoop(fits.models[model])) for name, model in names.items()]


def active_methods(fits: Fits, sample_time: float) -> list[Method]:
    """Active models with the paper's Q, which agree on this model."""
    model = fits.models[ColemanHodgdon.name]
    return [
        as_method("AM", ActiveModel(model, sample_time)),
        as_method("KF", KalmanActiveModel(model, sample_time)),
        as_method("UKF", UnscentedActiveModel(model, sample_time)),
    ]


def set_filters(
    fits: Fits, records: Sequence[tuple[Array, Array]], sample_time: float, wire_offset: float
) -> dict[str, SetMembershipFilter]:
    """Set-membership filters: one bound found on the training records, one from geometry alone.

    Args:
        fits: for the Coleman-Hodgdon model.
        records: training records with their truth.
        sample_time: T [s].
        wire_offset: the smallest that a twin may have [m].
    """
    model = fits.models[ColemanHodgdon.name]
    found = bound_model_error(model, records, sample_time)
    geometric = geometric_error_bound(wire_offset, found.floor_deg)
    return {
        "ESMF": SetMembershipFilter(model, sample_time, found),
        "ESMF (geometry)": SetMembershipFilter(model, sample_time, geometric),
    }


def tuned_methods(fits: Fits, records: Sequence[tuple[Array, Array]], sample_time: float) -> list[Method]:
    """What a sceptic asks for: filters tuned on the training records, and more of their kind with that Q."""

    def tuned(name: str, kind: type[ActiveModel] = ActiveModel) -> ActiveModel:
        filter_ = fits.tuned[name].filter(fits.models[TUNED_WITH[name]], sample_time)
        return kind(**vars(filter_))

    return [
        as_method("AM-tuned", tuned("AM")),
        as_method("AM-tuned (Q, R)", tuned("AM (Q, R)", UntoldActiveModel)),
        as_method("AM-tuned (Bouc-Wen)", tuned("AM (Bouc-Wen)")),
        as_method("UKF-tuned (Bouc-Wen)", tuned("UKF (Bouc-Wen)", UnscentedActiveModel)),
        as_method("AM-tuned (P-I)", tuned("AM (P-I)")),
        as_method("Huber", tuned("AM", RobustActiveModel)),
        as_method("VB", AdaptiveActiveModel(tuned("AM"))),
        as_method("AM with bias", tuned("AM", BiasedActiveModel)),
        as_method("Koopman", tuned_koopman(fits, records)),
        as_method(
            "Constant gain", ConstantGain(fits.models[ColemanHodgdon.name], sample_time, gain=fits.gain)
        ),
    ]
