"""Fit of a bench's unknowns to published values."""
