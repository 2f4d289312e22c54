"""Comparison of runs: numbers that differ, sizes of the differences, and their certainty."""
