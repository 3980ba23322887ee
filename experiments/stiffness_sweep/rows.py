"""Sort the points of the stiffness sweep by their purpose."""

from collections.abc import Mapping, Sequence
from typing import Any

from serpent_twin.reservoir.grid_point import GridPoint, Measuring
from serpent_twin.reservoir.sweep_rows import SweepRow, row_of

Rows = Mapping[str, Sequence[SweepRow]]
"""Rows by the purpose of their points"""


def rows_of(
    points: Mapping[str, Sequence[GridPoint]],
    found: Mapping[GridPoint, Mapping[str, Any]],
    measuring: Measuring,
) -> dict[str, list[SweepRow]]:
    """Rows by what they are for, out of what was found at each point."""
    return {
        name: [row_of(point, found[point], measuring) for point in of]
        for name, of in points.items()
    }
