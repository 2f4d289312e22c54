"""Drifts and jumps of a rig's numbers over its runs."""
