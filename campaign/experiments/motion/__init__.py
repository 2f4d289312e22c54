"""Recorded motion of any origin."""
