"""Show a session beside its twins: as a recording for rerun, a picture or a video."""
