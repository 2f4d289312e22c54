"""Stick-slip: a load pulled through a spring."""
