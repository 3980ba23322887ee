"""How are a take's markers put into session logs?"""

from serpent_twin.sessions.merge.merge import HEADING, Merge, merge

__all__ = ["HEADING", "Merge", "merge"]
