"""Open the serpent arm, whose logs are checked sessions."""

from serpent_twin.machines.arm.sessions import SessionRig, open_arm

__all__ = ["SessionRig", "open_arm"]
