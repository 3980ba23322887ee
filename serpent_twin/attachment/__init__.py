"""Let a corrected twin run in any MuJoCo program."""

from serpent_twin.attachment.attached import Attached
from serpent_twin.attachment.attaching import attach

__all__ = ["Attached", "attach"]
