"""Estimate the pose of an arm while it moves."""
