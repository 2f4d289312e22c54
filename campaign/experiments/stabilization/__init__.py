"""Stabilization while the hull moves, by compensation."""
