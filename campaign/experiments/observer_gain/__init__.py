"""Stabilization over the gain of a friction observer."""
