"""Excitation: a designed command, recorded to identify from."""
