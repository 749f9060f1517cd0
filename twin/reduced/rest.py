"""State of reduced twins at rest, before a run: wound up, and let go to where friction holds the section."""

from collections.abc import Sequence

import numpy as np

from twin.preset.preset import Preset
from twin.reduced.advance import advance
from twin.reduced.parameters import Parameters
from twin.reduced.state import ReducedState, new_state
from twin.reduced.workspace import new_workspace


def state_at_rest(presets: Sequence[Preset], parameters: Parameters) -> ReducedState:
    """Return the state of endoscopes that nothing has pulled yet.

    A section that is curved by itself is built straight, and let go slowly: one increment without viscosity.

    Args:
        presets: M endoscopes.
        parameters: theirs.
    """
    state = new_state(parameters, np.array([preset.sheath_bend for preset in presets]))
    if any(any(preset.initial_bends) for preset in presets):
        still = np.zeros(len(presets))
        slow = parameters._replace(wire_damping=still, hinge_damping=still)
        advance(slow, state, new_workspace(parameters), state.command.copy(), 1)
        state.time[:] = 0.0
        state.slip[:] = state.turn[:] = 0
    return state
