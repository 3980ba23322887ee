"""OptiTrack's live stream: reading it, and a server of it for people without cameras."""
