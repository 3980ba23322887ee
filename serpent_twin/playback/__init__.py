"""Show a session beside its twins: as a recording for rerun, a picture or a video."""

from serpent_twin.playback.picture import draw_picture
from serpent_twin.playback.recording import play_back
from serpent_twin.playback.shown import ShownSession
from serpent_twin.playback.video import draw_video

__all__ = ["ShownSession", "draw_picture", "draw_video", "play_back"]
