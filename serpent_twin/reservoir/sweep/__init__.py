"""How does what a body computes, and how well its pose can be told, change with its cables?

Many twins, one file a point, one table: `python -m serpent_twin.sweep`.
"""
