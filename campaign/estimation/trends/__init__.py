"""Numbers of a rig over its runs: drifts, jumps, and what of them is declared."""
