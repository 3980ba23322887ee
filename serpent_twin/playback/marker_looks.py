"""State how measured, predicted and estimated markers look, wherever a session is drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array

Rows = NDArray[np.intp]
Colour = tuple[int, int, int]
"""Red, green, blue, 0 … 255"""

MEASURED, ESTIMATED, TWIN = (70, 215, 120), (255, 150, 30), (150, 165, 190)
NOMINAL, CORRECTED = (235, 90, 90), (80, 160, 255)


@dataclass(frozen=True)
class EstimatedMarkers:
    """Markers by a readout, for the rows of the log that have a whole window."""

    name: str
    """The readout's name"""
    row: Rows
    """Rows of the session, (N,)"""
    marker: Array
    """[m], (N, 9, 3)"""
    seen: str = ""
    """Whether it was trained on this session, as a sentence"""
