"""Plan the motion that decides what a trace's logs left open."""
