"""The published arm: its numbers, its kinematics, and its model in MJCF."""
