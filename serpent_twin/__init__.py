"""Digital twin of a cable-driven serpentine arm, and the loop that keeps the twin honest."""

import mujoco

_log = mujoco.MjLogConfig.get()
_log.logto_file = (
    False  # MuJoCo prints its warnings; it need not leave MUJOCO_LOG.TXT in the user's folder
)
_log.set()

__version__ = "0.1.0"
