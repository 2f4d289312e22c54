"""JSON: numbers and test vectors, for users who write the code themselves."""

from __future__ import annotations

import json
from collections.abc import Sequence

from campaign.controller_code.compensation import INPUTS, SampledCompensation
from campaign.controller_code.targets import Array, Target, vectors


def _files(made: SampledCompensation, head: Sequence[str], inputs: Array) -> dict[str, str]:
    """The JSON file by its name."""
    its = made.controller
    tree = {
        "about": [*head],
        "period_s": float(its.period[0]),
        "filter_pole": float(its.filter_pole[0]),
        "torque_per_current": float(its.torque_per_current[0]),
        "rate_of": "load_angle" if its.fed_by_encoder else "gyro_rate",
        "torque_limit": made.bench.limits.torque,
        "linear": {each: getattr(its, each)[..., 0].tolist() for each in "abcd"},
        "options": made.bench.compensation[made.name].model_dump(mode="json"),
        "friction": [
            {
                "rate": each.rate,
                "torque": each.torque,
                "viscous": each.viscous,
                "angle": "motor" if motor else "load",
                "ripple": each.ripple,
                "parameters": each.parameters.tolist(),
            }
            for each, motor in zip(made.interfaces, made.motor_side, strict=True)
        ],
        "inputs": INPUTS,
        "vectors": vectors(made, inputs).tolist(),
    }
    text = json.dumps(tree, indent=1, ensure_ascii=False) + "\n"
    return {f"{made.identifier}.json": text}


TARGETS = (Target("json", _files),)
