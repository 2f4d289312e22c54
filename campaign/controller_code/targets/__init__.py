"""Targets of `campaign export-compensation`: each module here lists its own in `TARGETS`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.controller_code.compensation import INPUTS, SampledCompensation

Array = NDArray[np.float64]
BOUND = 1e-8
"""Tolerance, relative to the largest torque of the vectors, of code that uses the exponential
function of its platform. Most models keep 1e-12; `leuven` has 1e-9 on its vectors. Its torques
can change by 1e-2 if an input changes in the last digit.
"""


@dataclass(frozen=True)
class Target:
    """Format of `--to NAME`.

    write: returns texts by file name, from a compensation, head lines, and test inputs (n, 4).
    """

    name: str
    write: Callable[[SampledCompensation, Sequence[str], Array], dict[str, str]]


def targets() -> dict[str, Target]:
    """All targets by name."""
    names = sorted(each.name for each in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    return {target.name: target for module in modules for target in module.TARGETS}


def vectors(made: SampledCompensation, inputs: Array) -> Array:
    """`INPUTS` and the torque of this program, shape (n, 5)."""
    return np.column_stack([inputs, made.torques(inputs)])


def about(made: SampledCompensation, head: Sequence[str]) -> list[str]:
    """Head lines of any code: its origin, and how to call it."""
    period = float(made.controller.period[0])
    rate, angle, torque = map(made.unit, ("rad/s", "rad", "N m"))
    limit = f"{made.bench.limits.torque!r} {torque}"
    return [
        *head,
        "",
        f"Call it every {period!r} s ({1.0 / period:.9g} Hz). Inputs: {', '.join(INPUTS)}",
        f"  ({rate}; {angle}, relative; {angle} at the load: the motor's by the gear ratio; A).",
        f"It gives the torque to add ({torque} at the load). A reading that is infinite or NaN",
        f"keeps torque and states of the sample before. Limit: {limit}.",
    ]
