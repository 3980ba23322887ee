"""Simulate twins: one or many at a time, driven by motors or by logged motor angles."""
