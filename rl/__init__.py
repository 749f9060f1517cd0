"""Everything that learns: environments, PPO, recurrent networks and learned gains, and the export of them."""

import contextlib
import os
import tempfile

# An optimiser of torch makes this folder for compiled code, of which there is none here: no new folder.
os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", tempfile.gettempdir())

with contextlib.suppress(ImportError):  # without the extra `rl` there is no Gymnasium
    import rl.registration  # noqa: F401
