"""Frequency responses of the loop, opened or closed."""
