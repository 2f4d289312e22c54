"""Bristle stiffness, bristle damping and inertia from motion below breakaway, by output error.

`plant`: model; `simulation`: its response to a torque; `record`: measured data; `fit`: joint fit
over trials; `uncertainty`: covariance of its parameters; `shape`: test whether a single bristle
describes the data; `presliding_fit`: estimates.
"""
