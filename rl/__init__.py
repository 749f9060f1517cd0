"""Everything that learns: environments, PPO, recurrent networks and learned gains, and the export of them."""

import contextlib
import os
import tempfile

# torch creates this folder for compiled code, which is not used here: reuse an existing one.
os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", tempfile.gettempdir())

with contextlib.suppress(ImportError):  # without the extra `rl` there is no Gymnasium
    import rl.registration  # noqa: F401
