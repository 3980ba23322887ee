"""Describe the published arm: its numbers, its kinematics, and its model in MJCF."""

import mujoco

_log = mujoco.MjLogConfig.get()
_log.logto_file = False  # MuJoCo prints its warnings; no MUJOCO_LOG.TXT in the user's folder
_log.set()
