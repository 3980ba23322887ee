"""Turn units as a file names them into SI units and radians."""

from math import pi

TO_SI: dict[str, tuple[float, str]] = {
    "1": (1.0, "1"),
    "%": (0.01, "1"),
    "m": (1.0, "m"),
    "cm": (1e-2, "m"),
    "mm": (1e-3, "m"),
    "µm": (1e-6, "m"),
    "rad": (1.0, "rad"),
    "mrad": (1e-3, "rad"),
    "deg": (pi / 180, "rad"),
    "turn": (2 * pi, "rad"),
    "m/s": (1.0, "m/s"),
    "mm/s": (1e-3, "m/s"),
    "rad/s": (1.0, "rad/s"),
    "deg/s": (pi / 180, "rad/s"),
    "rpm": (2 * pi / 60, "rad/s"),
    "m/s²": (1.0, "m/s²"),
    "g": (9.80665, "m/s²"),
    "T": (1.0, "T"),
    "µT": (1e-6, "T"),
    "N": (1.0, "N"),
    "mN": (1e-3, "N"),
    "kN": (1e3, "N"),
    "N m": (1.0, "N m"),
    "mN m": (1e-3, "N m"),
    "s": (1.0, "s"),
    "ms": (1e-3, "s"),
    "µs": (1e-6, "s"),
    "ns": (1e-9, "s"),
}
"""How many of its SI unit a unit is, and which that is"""
