"""Searches cut short, for tests whose assertions do not depend on how good their ends are."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from scipy.optimize import minimize

EVALUATIONS = 150


def tune_filters(patch: pytest.MonkeyPatch) -> None:
    """Filters are tuned by few evaluations of their likelihood or RMSE."""

    def briefly(*args: Any, options: dict[str, Any], **others: Any) -> Any:
        most = min(options["maxfev"], EVALUATIONS)
        return minimize(*args, options=options | {"maxfev": most}, **others)

    patch.setattr("scipy.optimize.minimize", briefly)


def work_in_place(patch: pytest.MonkeyPatch) -> None:
    """Work of local workers is done in this process, in turn: that they do the same has its own tests."""
    patch.setattr("twin.workers.processes.local_workers", lambda *_: ThreadPoolExecutor(1))


def choose_members(patch: pytest.MonkeyPatch) -> None:
    """Members of RAM (twins) are chosen from few endoscopes along few commands."""
    patch.setattr("rl.twins.members.CANDIDATES", 2)
    patch.setattr("rl.twins.members.COMMANDS", 2)
