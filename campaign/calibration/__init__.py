"""Fitting the unknowns of a bench to published values."""
