"""Runs held against each other: which numbers differ, by how much, and how sure that is."""
