"""Version of the engine, archived with every recording."""

from __future__ import annotations

ENGINE = 4
"""Raised by every change that changes a simulated sample of any trial: integration, friction,
scatter, noise, sensors, controllers, compensation, base motion. Not by what is faster or told
better. The changelog then says which results change and why; a change that forgot is noticed by
`tests/physics/test_engine_version.py`.
"""

FIRST = 1
"""That of archives which do not say."""
ERRORS = {1: 1.1e-3, 2: 2e-4, 3: 2e-4, 4: 2e-4}
"""By engine, the largest relative rms error of a rate or a current at its default step: the table
of docs/developers/physics.md."""
TORQUE_ERRORS = {1: 1.2e-2, 2: 2e-4, 3: 2e-4, 4: 2e-4}
"""The same of a recorded friction or compensation torque; engine 1 recorded it half a step late."""
DRY_ERRORS = {1: 1.1e-2, 2: 1.1e-2}
DRY_TORQUE_ERRORS = {1: 1.2e-2, 2: 3e-3}
"""Both where the bench has a dry friction model, which engines before 3 met in first order. Static
compensation of a dry bench is not among them: at rest it had another meaning. Nor, in any table, is
sampled compensation by friction models before engine 4, which ran on an older rate."""
