"""Inverse dynamics: inertia and friction of any motion, by regression of the force."""
