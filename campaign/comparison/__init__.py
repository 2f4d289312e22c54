"""Comparison of runs: different numbers, sizes of the differences, and their certainty."""
