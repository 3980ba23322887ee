"""Simulate any MuJoCo model in time steps, at rest and with dry friction."""

import serpent_twin.mujoco_log  # noqa: F401 before anything warns
