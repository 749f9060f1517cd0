"""Changes to a recipe as it stands in a file: what is given goes before what the file says."""

from collections.abc import Mapping
from typing import Any

CHOSEN_INSTEAD = {"command_csv": ("given_pull_m", "given_lateral_pull_m"), "randomize": ("ranges",)}
"""Keys that a change makes void, by the key that is changed."""
SHORT_FORMS = {"command_csv": "file"}
"""Key within a mapping that a value stands for where it is written without its mapping, by the key."""


def change_recipe(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a recipe with some of them changed.

    Args:
        values: as in a recipe's file.
        changes: by key; a mapping, such as `set` or `sensor`, changes only the keys within it that it names.
    """
    changed = dict(values)
    for key, value in changes.items():
        there = changed.get(key) or {}
        if key == "sensor" and isinstance(value, Mapping) and "stereo" in value:
            there = {}  # two cameras are another sensor
        if key in SHORT_FORMS and not isinstance(there, Mapping):
            there = {SHORT_FORMS[key]: there}
        changed[key] = {**there, **value} if isinstance(value, Mapping) else value
        for void in CHOSEN_INSTEAD.get(key, ()):
            changed.pop(void, None)
    return changed
