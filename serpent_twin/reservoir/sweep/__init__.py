"""Measure how a body's computation and the accuracy of its pose depend on its cables.

Many twins, one file per grid point, one table: `python -m serpent_twin.sweep`.
"""
