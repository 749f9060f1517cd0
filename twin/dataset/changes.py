"""Changes to a recipe as it stands in a file: what is given goes before what the file says."""

from collections.abc import Mapping
from typing import Any

CHOSEN_INSTEAD = {"command_csv": "given_pull_m", "randomize": "ranges"}
"""Key that a change makes void, by the key that is changed."""


def change_recipe(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a recipe with some of them changed.

    Args:
        values: as in a recipe's file.
        changes: by key; a mapping, such as `set` or `sensor`, changes only the keys within it that it names.
    """
    changed = dict(values)
    for key, value in changes.items():
        changed[key] = {**(changed.get(key) or {}), **value} if isinstance(value, Mapping) else value
        changed.pop(CHOSEN_INSTEAD.get(key, ""), None)
    return changed
