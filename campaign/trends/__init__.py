"""Trends of a rig's numbers over its runs: drifts, jumps, dependence on a covariate."""
