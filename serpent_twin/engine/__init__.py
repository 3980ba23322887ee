"""Simulate any MuJoCo model in time steps, at rest and with dry friction."""
