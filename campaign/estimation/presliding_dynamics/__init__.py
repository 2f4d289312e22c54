"""Bristle stiffness, bristle damping and inertia from motion below breakaway, by output error.

`plant` is what moves, `simulation` how it answers to a torque, `record` what was measured, `fit`
the joint fit over trials, `uncertainty` what its intervals rest on, `shape` whether a single
bristle describes the data at all, `found` the numbers for a reader.
"""
