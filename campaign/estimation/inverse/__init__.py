"""Inverse dynamics: drive force as a sum of terms of the motion, by regression."""
