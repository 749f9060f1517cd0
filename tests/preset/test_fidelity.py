"""Named fidelities: what they change, and that their error is what is stated."""

import numpy as np
import pytest

from scripts.benchmarks.physics import REFERENCE, SAMPLE_TIME, bends_of, errors_deg
from twin.preset.file import load_preset
from twin.preset.preset import FIDELITIES, Preset, at_fidelity
from twin.signals.excitation import command

AMPLITUDE = {"ureteroscope": 4e-3, "vio_com": 10e-3}  # [m]


@pytest.mark.slow
@pytest.mark.parametrize("name", AMPLITUDE)
def test_error_of_each_fidelity_is_what_is_stated(name):
    """Against a finer division, with the signals that tell fidelities apart."""
    preset, stroke = load_preset(name), (-AMPLITUDE[name], AMPLITUDE[name])
    pulls = [
        command(signal, stroke, 4.0, SAMPLE_TIME, np.random.default_rng(4))
        for signal in ("multi-sine", "random-steps")
    ]
    few = preset.replace(vertebrae=8)  # more of them change 0.001 % of the range, and take longer
    reference = bends_of(few.replace(**REFERENCE), pulls)
    errors = {f: errors_deg(bends_of(at_fidelity(preset, f), pulls), reference) for f in FIDELITIES}
    for fidelity, (rms, most) in errors.items():
        assert rms <= FIDELITIES[fidelity].rms_deg, (fidelity, rms)
        assert most <= FIDELITIES[fidelity].most_deg, (fidelity, most)
    if errors["standard"][0] > 0.003:  # below, what is left is that of the steps of either
        assert errors["fine"][0] < errors["standard"][0] / 2
    assert errors["standard"][0] < 1.1 * errors["fast"][0]  # five elements count more than the step


def test_fidelity_changes_parts_and_steps_alone():
    preset = load_preset("ureteroscope")
    assert at_fidelity(preset, "standard") == preset
    for name in FIDELITIES:
        divided = at_fidelity(preset, name)
        changed = {key for key, value in divided.to_dict().items() if value != preset.to_dict()[key]}
        assert changed <= {"vertebrae", "sheath_elements", "time_step"}


def test_unknown_fidelity_and_one_that_does_not_fit_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"^unknown fidelity 'fats' \(did you mean 'fast'\?\); valid: fine"):
        at_fidelity(Preset("any"), "fats")
    odd = Preset("odd", time_step=1e-3, control_period=3e-3)
    with pytest.raises(ValueError, match=r"^fidelity fine of .odd.: .*control_period") as refused:
        at_fidelity(odd, "fine")
    assert "\n" not in str(refused.value)
