"""Inverse dynamics: what drives a motion as a sum of what the motion asks for, by regression."""
