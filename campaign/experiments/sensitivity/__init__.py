"""Stabilization with wrong parameters of the compensation."""
