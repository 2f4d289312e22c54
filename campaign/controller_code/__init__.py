"""Compensations as controller code: parameters of a bench, step functions in its language."""
