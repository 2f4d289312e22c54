"""Recorded motion: what anybody moved the axis by."""
