"""Inverse dynamics of recorded motions: inertia and friction by regression of the force."""

from campaign.experiments.any_motion.inverse_result import InverseDynamicsOptions, identify
from campaign.experiments.any_motion.motions import usable
from campaign.experiments.shared.recorded_motion import of_any_motion

EXPERIMENT = of_any_motion(
    name="inverse_dynamics",
    summary="inertia and friction of any motion, by regression of the force",
    options=InverseDynamicsOptions,
    suits=usable,
    identify=identify,
)
