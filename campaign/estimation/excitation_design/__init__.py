"""Motions and torques made to identify from: pure functions on arrays, all of them seeded."""
