"""Compensations as code for a controller: numbers of a bench, step functions in its language."""
