"""The Prandtl-Ishlinskii model against its plays one by one, closed forms and Madelung's rules."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.hysteresis import PrandtlIshlinskii, load_model
from twin.hysteresis.prandtl_ishlinskii import plays_along

WEIGHTS, THRESHOLDS = (8.0, 4.0, 6.0, 3.0), (0.0, 0.25, 0.5, 0.9)
MODEL = PrandtlIshlinskii(WEIGHTS, THRESHOLDS)
pulls = st.floats(-5, 5)
paths = st.lists(pulls, min_size=3, max_size=30).map(np.array)


def play_of(path: np.ndarray, threshold: float) -> np.ndarray:
    """A loose pin in a slot: the slot moves only when the pin is at one of its ends."""
    slot, along = 0.0, []
    for pin in path:
        if pin - slot > threshold:
            slot = pin - threshold
        elif slot - pin > threshold:
            slot = pin + threshold
        along.append(slot)
    return np.array(along)


@given(path=paths, bend0=st.floats(-100, 100))
def test_response_is_the_weighted_sum_of_plays(path, bend0):
    total = sum(w * play_of(path, r) for w, r in zip(WEIGHTS, THRESHOLDS, strict=True))
    np.testing.assert_allclose(MODEL.response(path, bend0), bend0 + total - total[0], atol=1e-10)


@given(path=paths, bend0=st.floats(-100, 100))
def test_single_steps_equal_the_whole_response(path, bend0):
    bend, memory = np.array([bend0]), MODEL.start(path[:1])
    for k in range(1, len(path)):
        before = memory.copy()
        stepped, after = MODEL.step(bend, memory, path[k : k + 1], path[k - 1 : k])
        np.testing.assert_array_equal(memory, before)  # what was given is left as it is
        bend, memory = stepped, after
        np.testing.assert_allclose(bend, MODEL.response(path, bend0)[k], atol=1e-9)


@given(path=paths, deviation=st.floats(-60, 60))
def test_deviation_of_the_angle_stays_as_it_is(path, deviation):
    """What a filter corrects stays corrected: the slope is one."""
    np.testing.assert_allclose(
        MODEL.response(path, 20 + deviation), MODEL.response(path, 20.0) + deviation, atol=1e-10
    )
    np.testing.assert_array_equal(MODEL.slope(np.zeros(3), np.ones(3), np.zeros(3)), np.ones(3))


@given(path=paths, inner=st.floats(-5, 5))
def test_closed_minor_loop_leaves_no_memory(path, inner):
    """Return-point memory (Madelung's third rule): once a detour is closed, it is as if it had never been."""
    low, high = sorted(path[-2:])
    detour = np.append(path, [np.clip(inner, low, high), path[-1]])
    np.testing.assert_allclose(
        plays_along(detour, THRESHOLDS)[:, -1], plays_along(path, THRESHOLDS)[:, -1], atol=1e-12
    )


@pytest.mark.parametrize("amplitude", [0.4, 1.0, 3.0])
def test_area_of_a_loop_is_that_of_its_parallelograms(amplitude):
    """The loop of a play is 2 r wide and 2 (A - r) high."""
    phase = np.linspace(0, 2 * np.pi, 40001)
    cycle = amplitude * np.cos(phase)
    pull = np.concatenate([cycle, cycle])
    bend = MODEL.response(pull, 0.0)[40001:]
    area = abs(np.trapezoid(bend, cycle))
    expected = sum(
        4 * w * r * (amplitude - r) for w, r in zip(WEIGHTS, THRESHOLDS, strict=True) if r < amplitude
    )
    assert area == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"weights_deg_per_mm": [8.0, 4.0]}, "of one length"),
        ({"weights_deg_per_mm": [8.0, -4.0, 6.0, 3.0]}, "not negative"),
        ({"thresholds_mm": [0.0, -0.25, 0.5, 0.9]}, "not negative"),
        ({"weights_deg_per_mm": [8.0, None, 6.0, 3.0]}, "every entry must be a finite number"),
        ({"thresholds_mm": [0.0, 1e300, 0.5, 0.9]}, "every entry must be a finite number"),
        ({"thresholds_mm": 0.5}, "thresholds_mm is 0.5: must be a list of numbers"),
        ({"thresholds_mm": []}, "must be a list of numbers"),
    ],
)
def test_file_that_is_no_such_model_is_refused(tmp_path, change, fault):
    path = tmp_path / "prandtl_ishlinskii.json"
    path.write_text(json.dumps({"model": "prandtl-ishlinskii", **MODEL.to_dict(), **change}))
    with pytest.raises(ValueError, match=r"prandtl_ishlinskii\.json is no Prandtl-Ishlinskii") as refused:
        load_model(path)
    assert fault in str(refused.value)
