"""Frequency response of a drive from trials of a run."""
