"""Meaning of the rows of simulation arrays: states, inputs, sensors, outputs.

The loop's matrices, the engine and the friction models exchange arrays whose first axis has these
rows, and whose last axis has the lanes: trials that are simulated at once, each with parameters of
its own. Every other module uses the names.
"""

from __future__ import annotations

# States that every loop has; the appendage's two and the continuous controller's own follow.
RATE, ANGLE, RELATIVE_ANGLE, CURRENT, CURRENT_INTEGRAL = range(5)
DEFLECTION, APPENDAGE_RATE = 5, 6
PLANT_STATES = 5

# Inputs. DRIVE is the commanded rate or torque, or, with a sampled controller, the current.
DRIVE, BASE_RATE, FRICTION, COMPENSATION = range(4)
INPUTS = 4

SENSORS = GYRO, ENCODER, RESOLVER, CURRENT_SENSOR = 0, 1, 2, 3

# What a simulation gives of every recorded sample.
OUTPUTS = (
    "gyro_rate",
    "relative_rate",
    "relative_angle",
    "motor_current",
    "pointing_angle",
    "compensation_torque",
    "friction_torque",
    "load_rate",
)
(
    OUT_GYRO,
    OUT_RELATIVE_RATE,
    OUT_ANGLE,
    OUT_CURRENT,
    OUT_POINTING,
    OUT_COMPENSATION,
    OUT_FRICTION,
    OUT_LOAD_RATE,
) = range(8)

# What every interface meets over a step, as the load sees it.
(
    MEETS_RATE_START,
    MEETS_RATE_END,
    MEETS_RATE_MEAN,
    MEETS_PUSH,
    MEETS_COMPLIANCE,
    MEETS_POSITION,
    MEETS_RIPPLE,
    MEETS_STEP,
    MEETS_PER_STEP,
) = range(9)
MEETS = 9

# What is fixed of an interface, before the parameters of its model.
(
    HAS_RATE,
    HAS_TORQUE,
    HAS_PER_TORQUE,
    HAS_STATE,
    HAS_TEMPERATURE,
    HAS_NORMAL_LOAD,
) = range(6)
HAS = 6

# What an interface keeps, before the state of its model.
KEEPS_TORQUE = 0
KEEPS = 1

# What all interfaces together answer: a torque that is a straight line over the step; and what of
# it stands when it ends.
MEAN, CHANGE, HELD = range(3)
ANSWERS = 3

# What a sampled controller keeps from sample to sample.
(
    KEPT_INTEGRAL,
    KEPT_LOAD_RATE,
    KEPT_MOTOR_RATE,
    KEPT_ENCODER,
    KEPT_RESOLVER,
    KEPT_POINTING,
    KEPT_GYRO,
    KEPT_CURRENT,
    KEPT_TORQUE,
) = range(9)
KEPT = 9

# What dry friction keeps from step to step, and then what it does over one: see `dry_friction`.
(
    DRY_DIRECTION,
    DRY_ENDED,
    DRY_MEAN,
    DRY_CHANGE,
    DRY_START,
    DRY_END,
    DRY_BEFORE,
    DRY_LEAVES,
    DRY_BEGINS,
    DRY_MOTION,
    DRY_HOLDS_FORWARDS,
    DRY_HOLDS_BACKWARDS,
    DRY_STARTS_FORWARDS,
    DRY_STARTS_BACKWARDS,
    DRY_GAIN,
) = range(15)
DRY = 15
LIMITS = 4
"""Of one dry interface: its rows DRY_HOLDS_FORWARDS to DRY_STARTS_BACKWARDS."""

# What a sliding torque is asked at.
ASKED_DIRECTION, ASKED_SPEED = range(2)
ASKED = 2
