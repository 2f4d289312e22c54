"""Friction experiments on stabilized servo platforms: run, archive, identify, report."""

__version__ = "0.1.0"
