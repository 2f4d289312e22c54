"""Version of the engine, archived with every recording."""

from __future__ import annotations

ENGINE = 4
"""Increases with every change of a simulated sample of any trial: integration, friction, scatter,
noise, sensors, controllers, compensation, base motion. Speed and texts do not count. The changelog
states which results change and why; `tests/physics/test_engine_version.py` detects a missing
increase.
"""

FIRST = 1
"""Version of archives without a version."""
ERRORS = {1: 1.1e-3, 2: 2e-4, 3: 2e-4, 4: 2e-4}
"""Largest relative RMS error of a rate or a current at the default step, by engine: the table of
docs/developers/physics.md."""
TORQUE_ERRORS = {1: 1.2e-2, 2: 2e-4, 3: 2e-4, 4: 2e-4}
"""The same for recorded friction or compensation torque; engine 1 recorded it half a step late."""
DRY_ERRORS = {1: 1.1e-2, 2: 1.1e-2}
DRY_TORQUE_ERRORS = {1: 1.2e-2, 2: 3e-3}
"""Both for a bench with a dry friction model; engines before 3 had first order there. They exclude
static compensation of a dry bench, which had another definition at rest. All tables exclude sampled
compensation by friction models before engine 4, which used an older rate."""
