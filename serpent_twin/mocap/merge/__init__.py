"""How are a take's markers put into session logs?"""

from serpent_twin.mocap.merge.merge import HEADING, Merge, merge

__all__ = ["HEADING", "Merge", "merge"]
