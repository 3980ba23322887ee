"""Fit a twin's parameters, with their standard errors and what several directions leave undetermined."""
