"""Test motions, once per connection, that verify a drive's objects."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.ends import End
from campaign.canopen_drive.settings import Objects, present, written
from campaign.canopen_drive.units import Scale
from campaign.physics.bench import LimitsOptions

RATE = 100.0
"""Hz; sample rate of the test motions."""
LEG = 1.0
"""s; duration of a slow move, one way."""
RATE_SHARE, ANGLE_SHARE = 0.1, 0.1
"""Rate and distance of a slow move as shares of the limits."""
TOLERANCE = 0.2
"""Relative tolerance of the measured rate."""
REACTION = 2.0
"""s in addition to three heartbeats in which the drive must stop by itself."""
FAST = 0.5
"""Rate of the move to a trial's start angle as a share of the rate limit."""
LONGEST = 6.0
"""s; longest such move: samples must begin within 15 s of a trial's start."""
CLOSE = 5
"""Samples of slow motion; a shorter distance is not corrected."""
HOLD = 0.5
"""s at the largest torque, at the speed limit."""
OVERSHOOT, UNBOUNDED = 1.5, 8.0
"""Multiples of the speed limit: largest permitted settled rate; rate at which the relay stops."""

Play = Callable[..., tuple[np.ndarray, Mapping[str, Any]]]
"""See `Player.rows`."""


@dataclass(frozen=True)
class Proof:
    """Test motions of a drive, with its scale and limits."""

    drive: Objects
    play: Play
    scale: Scale
    limits: LimitsOptions

    @property
    def slow(self) -> float:
        """Rate of slow moves (rad/s)."""
        return min(RATE_SHARE * self.limits.rate, ANGLE_SHARE * self.limits.angle / LEG)

    def moves_as_commanded(self) -> None:
        """Move forth and back; compare the commanded rate with position and velocity.

        Raises DriveError.
        """
        target_rate, count = round(self._inward() * self.slow * self.scale.rate), round(LEG * RATE)
        rows = self._rate([target_rate] * count + [-target_rate] * count + [0] * (count // 10))
        for leg, target in ((rows[:count], target_rate), (rows[count : 2 * count], -target_rate)):
            settled = leg[3 * count // 4 :]
            travel = (settled[-1, 3] - settled[0, 3]) / (len(settled) - 1) * RATE
            wanted = target / self.scale.rate
            for name, rate in (
                ("position (6064h)", travel / self.scale.position),
                ("velocity (606Ch)", float(settled[:, 1].mean()) / self.scale.rate),
            ):
                if abs(rate - wanted) > TOLERANCE * abs(wanted):
                    raise DriveError(
                        f"a slow move at {wanted:.4g} rad/s shows {rate:.4g} rad/s by {name}: "
                        "scale or sign are wrong; check the drive's factors, "
                        "backend.units_per_turn and backend.rate_units"
                    )

    def stops_in_silence(self, heartbeat: float) -> None:
        """Stop the heartbeat (s) in a slow move. Raises DriveError if the drive does not stop."""
        target_rate, count = (
            round(self._inward() * self.slow * self.scale.rate),
            round(LEG / 4 * RATE),
        )
        mute = {"mute": count - 1, "mute_patience": 3 * heartbeat + REACTION}
        _, end = self.play(self._job([target_rate] * count, od.PROFILE_VELOCITY) | mute)
        if not end["reacted"]:
            raise DriveError(
                "the drive moved on when the heartbeat fell silent; check 1016h, 1029h and 6007h"
            )

    def keeps_speed_limit(self, peak: float) -> None:
        """Apply torque up to `peak` (N m) with a low speed limit. Raises DriveError."""
        slow, sign = self.slow, self._inward()
        both = (od.MAX_PROFILE_VELOCITY, od.MAX_MOTOR_SPEED)
        had = {item: value for item in both if (value := present(self.drive, item)) is not None}
        ramp = np.append(
            np.linspace(0, peak, round(LEG / 2 * RATE)), np.full(round(HOLD * RATE), peak)
        )
        job = self._job(np.rint(sign * ramp * self.scale.torque), od.PROFILE_TORQUE)
        job["fastest"] = round(UNBOUNDED * slow * abs(self.scale.rate))
        try:
            for item in had:
                factor = self.scale.motor_rate if item is od.MAX_MOTOR_SPEED else self.scale.rate
                written(self.drive, item, max(1, round(slow * abs(factor))))
            self.drive.write(
                od.TORQUE_SLOPE, max(1, round(2 * peak * abs(self.scale.torque) / LEG))
            )
            rows, end = self.play(job, End.RATE_LIMIT)
        finally:
            for item, value in had.items():
                written(self.drive, item, value)
        rates = np.abs(rows[:, 1] / self.scale.rate) if len(rows) else np.zeros(1)
        held = float(rates[-len(rates) // 4 :].mean())
        if end["end"] != End.PLAYED or not 0.5 * slow <= held <= OVERSHOOT * slow:
            raise DriveError(
                f"{', '.join(map(str, had))}: no limit of speed was seen to act in torque mode: at "
                f"{slow:.4g} rad/s, torque up to {peak:.4g} N m reached {rates.max():.4g} rad/s"
                + (f" ({end['why']})" if end["why"] else "")
            )

    def goes_to(self, position: int, *, fast: bool = False) -> None:
        """Move to a position of the drive: first fast, if `fast`, then slowly."""
        for rate in (FAST * self.limits.rate, self.slow) if fast else (self.slow,):
            distance = position - self.drive.read(od.POSITION)
            count = round(abs(distance / self.scale.position) / rate * RATE)
            if count > LONGEST * RATE:
                raise DriveError(
                    f"the way to the start angle takes {count / RATE:.3g} s at {rate:.3g} rad/s; "
                    f"turn the load nearer, at most {LONGEST:g} s are allowed"
                )
            raw = math.copysign(rate * abs(self.scale.rate), distance)
            if count > CLOSE:
                self._rate([round(raw)] * count + [0] * round(LEG / 10 * RATE))

    def _inward(self) -> int:
        """Sign of a motion toward zero."""
        return 1 if self.drive.read(od.POSITION) * self.scale.position <= 0 else -1

    def _rate(self, targets: list[int]) -> np.ndarray:
        return self.play(self._job(targets, od.PROFILE_VELOCITY))[0]

    def _job(self, targets: Any, mode: int) -> dict[str, Any]:
        return {"mode": mode, "targets": [int(each) for each in targets], "period": 1 / RATE}
