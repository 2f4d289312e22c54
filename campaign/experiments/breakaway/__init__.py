"""Breakaway: torque ramps until the load moves."""
