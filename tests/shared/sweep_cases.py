"""Sweeps of a second a point, for tests."""

from pathlib import Path

from serpent_twin.reservoir.grid_point import GridPoint, Measuring

QUICK = Measuring(
    delays=(4, 2), memory_delay=6, taps=1, stretches=10, washout=8, repeated=20, stream=2,
    coarsest=10.0, sessions=3, session_steps=120, readouts=("analytical", "residual"),
)  # fmt: skip
POINT = GridPoint(8e3, 3e-4, 1e-3, 20.0, 0.014, 0, 200)
UNSTABLE = 3e7
GRID = {
    "stiffness": (8e3,), "slack": (3e-4,), "damping": (1e-3,), "rate": (20.0,), "amplitude": (0.014,),
    "steps": 200, "rigid": True, "measuring": QUICK,
}  # fmt: skip


def files(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((out / "points").iterdir())}
