"""The interface of a friction specimen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from campaign.arrays import Array as Array
from campaign.options import Options


@dataclass(frozen=True)
class Specimen:
    """Many separately computed contacts along a prescribed motion.

    Attributes:
        name: value of its `model` option.
        summary: one line for `campaign kinds`.
        options: its parameters, with `model: Literal[name]`, in SI.
        torque: friction torque (N m), shape (n,), from validated options, times (s) and angles
            (rad), shape (n,) each. The angle is a straight line between two times. Contacts begin
            rested and undeflected.
        steady_state: expected torque (N m) at constant rates (rad/s), shape (m,).
    """

    name: str
    summary: str
    options: type[Options]
    torque: Callable[[Any, Array, Array], Array]
    steady_state: Callable[[Any, Array], Array]
