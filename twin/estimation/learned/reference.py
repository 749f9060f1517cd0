"""Reference steps in a trained file: inputs, and the outputs of the trained network for them.

`rl.export` writes them, computed by torch; here the deployed graph is run on the same inputs. A graph that
was changed or damaged, or that was exported wrong, returns something else.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import InputError
from twin.estimation.learned.trained_file import TrainedFile

if TYPE_CHECKING:
    from twin.files.trained_schema import NumbersFile

REFERENCE = "reference"  # key of them in the description of a trained file
ESTIMATE, PREVIOUS = "bend_deg", "previous_deg"
"""Output that is the estimate, and its name as a state of the next step."""


def after(name: str) -> str:
    """Return the name of the output that is this state of the next step."""
    return ESTIMATE if name == PREVIOUS else f"{name}_after"


def reference_to_dict(inputs: dict[str, Any], outputs: dict[str, Any]) -> dict[str, Any]:
    """Return reference steps as a trained file holds them; arrays of (steps, ...) by name."""

    def numbers(array: Any) -> dict[str, Any]:
        whole = np.asarray(array, dtype=float)
        return {
            "shape": list(whole.shape),
            "values": [None if np.isnan(value) else value for value in whole.ravel().tolist()],
        }

    return {
        part: {name: numbers(array) for name, array in arrays.items()}
        for part, arrays in (("inputs", inputs), ("outputs", outputs))
    }


def replay(file: TrainedFile) -> dict[str, float]:
    """Run the graph on the reference steps; returns the largest difference of each output.

    A difference is one of the angle where that is below 1 deg, and relative to it above.
    """
    # Here, so that a table of methods needs none of it.
    from twin.files.json_text import validated
    from twin.files.trained_schema import ReferenceFile

    reference = validated(ReferenceFile, file.description.get(REFERENCE) or {})
    try:
        inputs, wanted = (
            {name: _array(numbers) for name, numbers in part.items()}
            for part in (reference.inputs, reference.outputs)
        )
        names = [part.name for part in file.session.get_outputs()]
        states = {
            part.name: tuple(part.shape[1:]) for part in file.session.get_inputs() if part.name not in inputs
        }
        batch = max(len(steps[0]) for steps in inputs.values())
        memory = {name: np.zeros((batch, *shape)) for name, shape in states.items()}
        worst = dict.fromkeys(wanted, 0.0)
        for step in range(len(next(iter(inputs.values())))):
            returned = file.run(**{name: steps[step] for name, steps in inputs.items()}, **memory)
            found = dict(zip(names, returned, strict=True))
            for name, steps in wanted.items():
                difference = np.abs(found[name] - steps[step]) / np.maximum(np.abs(steps[step]), 1.0)
                worst[name] = max(worst[name], float(np.nan_to_num(difference, nan=np.inf).max()))
            memory = {name: found[after(name)] for name in states}
    except InputError:
        raise
    except Exception as error:  # a name or a shape that the graph has not, in classes of onnxruntime
        raise InputError("its reference steps do not fit its graph") from error
    return worst


def _array(numbers: "NumbersFile") -> Any:
    values = np.array([np.nan if value is None else value for value in numbers.values], dtype=float)
    if values.size != np.prod(numbers.shape):
        raise InputError("its reference steps are incomplete")
    return values.reshape(numbers.shape)
