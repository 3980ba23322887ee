"""Digital twin of a cable-driven serpentine arm, and the loop that keeps the twin honest."""

__version__ = "0.1.0"
