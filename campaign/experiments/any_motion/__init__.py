"""Any motion: its force by inverse dynamics, for the experiments that identify from it."""
