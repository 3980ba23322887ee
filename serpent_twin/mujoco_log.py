"""Keep MuJoCo from leaving a MUJOCO_LOG.TXT where a user works; it prints its warnings all the same."""

import mujoco

_log = mujoco.MjLogConfig.get()
_log.logto_file = False
_log.set()
