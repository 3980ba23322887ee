"""Import MuJoCo without the OpenGL that MUJOCO_GL names, which would be a traceback where it is missing.

A command that renders imports this first; `serpent_twin.playback.offscreen` reads MUJOCO_GL later.
"""

import os

_asked = os.environ.pop("MUJOCO_GL", None)
try:
    import mujoco  # noqa: F401
finally:
    if _asked is not None:
        os.environ["MUJOCO_GL"] = _asked
