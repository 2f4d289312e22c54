"""Sliding torque of a dry friction model, and its call from the engine.

It is a short function in plain Python for one interface of one trial. Compilation and restrictions
are those of a step function (`campaign.physics.step_function`)::

    sliding(parameters, direction, speed) -> float

parameters: of the model.   direction: 1.0 or -1.0.   speed: rad/s of the interface in that
direction, 0 or more. It returns the torque against the motion (N m, 0 or more), without the viscous
part.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import carray
from numba.extending import overload

from campaign.arrays import Array
from campaign.physics.compilation import compiled_callback
from campaign.physics.rows import ASKED_DIRECTION, ASKED_SPEED, HAS, HAS_RATE, HAS_TORQUE
from campaign.physics.step_function import SIGNATURE, own_name
from campaign.physics.vector import MOST_ROWS


def address_of_sliding(sliding: Callable[..., Any], lanes: int, parameters: int) -> int:
    """Address of the compiled function for these numbers of lanes, parameters; it stays valid."""
    with _COMPILING:
        return int(_compiled_once(sliding, lanes, parameters).address)


def single_sliding(
    sliding: Callable[..., Any], parameters: Array, direction: float, speed: float
) -> float:
    """Torque of one interface, with the engine's compiled code."""
    fixed = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0, *parameters])
    wave, asked, answer = np.ones(1), np.array([direction, speed]), np.zeros(1)
    address = address_of_sliding(sliding, 1, len(parameters))
    run = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(address)
    run(*(rows.ctypes.data for rows in (fixed, wave, asked, answer)))
    return float(answer[0])


_COMPILING = threading.RLock()


@cache
def _compiled_once(sliding: Callable[..., Any], lanes: int, parameters: int) -> Any:
    _known_to_numba(sliding)
    return compiled_callback(SIGNATURE, _by_lanes(sliding, lanes, parameters), sliding.__module__)


@cache
def _known_to_numba(sliding: Callable[..., Any]) -> None:
    overload(sliding, jit_options={"error_model": "numpy"}, inline="always", strict=False)(
        lambda parameters, direction, speed: sliding
    )


def _by_lanes(sliding: Any, lanes: int, parameters: int) -> Callable[..., None]:
    """Function that adds the torque at the load for `lanes` lanes; arrays as in `step_function`."""
    own_end = HAS + parameters

    def by_lanes(fixed: Any, wave: Any, asked: Any, answer: Any) -> None:
        has, waves = carray(fixed, (MOST_ROWS, lanes)), carray(wave, (MOST_ROWS, lanes))
        at, total = carray(asked, (MOST_ROWS, lanes)), carray(answer, (MOST_ROWS, lanes))
        for k in range(lanes):
            speed = at[ASKED_SPEED, k] * has[HAS_RATE, k]
            torque = sliding(has[HAS:own_end, k], at[ASKED_DIRECTION, k], speed)
            total[0, k] += torque * has[HAS_TORQUE, k] * waves[0, k]

    by_lanes.__qualname__ = own_name(sliding, lanes, parameters)
    return by_lanes
