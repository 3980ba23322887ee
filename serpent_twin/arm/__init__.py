"""Describe the published arm: its numbers, its kinematics, and its model in MJCF."""

import serpent_twin.mujoco_log  # noqa: F401 before anything warns
