"""Meaning of the rows of simulation arrays: states, inputs, sensors, outputs.

The loop's matrices, the engine and the friction models exchange arrays. The first axis has these
rows. The last axis has the lanes: trials simulated in parallel, each with its own parameters. All
other modules use the names.
"""

from __future__ import annotations

# States of every loop; those of the appendage (two) and of the continuous controller follow.
RATE, ANGLE, RELATIVE_ANGLE, CURRENT, CURRENT_INTEGRAL = range(5)
DEFLECTION, APPENDAGE_RATE = 5, 6
PLANT_STATES = 5

# Inputs. DRIVE is the commanded rate or torque, or, with a sampled controller, the current.
DRIVE, BASE_RATE, FRICTION, COMPENSATION = range(4)
INPUTS = 4

SENSORS = GYRO, ENCODER, RESOLVER, CURRENT_SENSOR = 0, 1, 2, 3

# Outputs of a simulation for each recorded sample.
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

# Motion of an interface over a step, at the load.
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

# Constants of an interface, before the parameters of its model.
(
    HAS_RATE,
    HAS_TORQUE,
    HAS_PER_TORQUE,
    HAS_STATE,
    HAS_TEMPERATURE,
    HAS_NORMAL_LOAD,
) = range(6)
HAS = 6

# State of an interface, before the state of its model.
KEEPS_TORQUE = 0
KEEPS = 1

# Sum of all interfaces: mean and change of a torque that is a straight line over the step. HELD:
# end of that line, only of models with a state.
MEAN, CHANGE, HELD = range(3)
ANSWERS = 3

# State of a sampled controller.
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

# State of dry friction, followed by its results for one step; see `dry_friction`.
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
"""Number of limits of a dry interface: rows DRY_HOLDS_FORWARDS to DRY_STARTS_BACKWARDS."""

# Arguments of a sliding torque.
ASKED_DIRECTION, ASKED_SPEED = range(2)
ASKED = 2
