"""Put a take's markers into session logs."""

from serpent_twin.sessions.merge.merge import HEADING, Merge, merge

__all__ = ["HEADING", "Merge", "merge"]
