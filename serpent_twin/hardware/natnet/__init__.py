"""Read OptiTrack's live stream."""
