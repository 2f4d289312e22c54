"""Motions that show, once per connection, that a drive does what its objects say."""

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
"""Hz."""
LEG = 1.0
"""s of a slow move, one way."""
RATE_SHARE, ANGLE_SHARE = 0.1, 0.1
"""Of the limits: how fast and how far it goes."""
TOLERANCE = 0.2
"""Relative, of the measured rate."""
REACTION = 2.0
"""s beyond three times the heartbeat in which the drive stops by itself."""
FAST = 0.5
"""Of the rate limit, on the way to where a trial starts."""
LONGEST = 6.0
"""s of one such move: samples have to come 15 s after a trial began."""
CLOSE = 5
"""Samples of slow motion: nearer it does not go."""
HOLD = 0.5
"""s at the largest torque, at the limit of speed."""
OVERSHOOT, UNBOUNDED = 1.5, 8.0
"""times the limit of speed: the most that it settles at, and where the relay ends it."""

Play = Callable[..., tuple[np.ndarray, Mapping[str, Any]]]
"""See `Player.rows`."""


@dataclass(frozen=True)
class Proof:
    """What the motions need: the drive, its scale, its limits, and the slow rate (rad/s)."""

    drive: Objects
    play: Play
    scale: Scale
    limits: LimitsOptions

    @property
    def slow(self) -> float:
        """In rad/s."""
        return min(RATE_SHARE * self.limits.rate, ANGLE_SHARE * self.limits.angle / LEG)

    def moves_as_commanded(self) -> None:
        """There and back: commanded rate against position and velocity. Raises DriveError."""
        way, count = round(self._inward() * self.slow * self.scale.rate), round(LEG * RATE)
        rows = self._rate([way] * count + [-way] * count + [0] * (count // 10))
        for leg, target in ((rows[:count], way), (rows[count : 2 * count], -way)):
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
        """Moves slowly while the heartbeat (s) falls silent. Raises DriveError if it goes on."""
        way, count = round(self._inward() * self.slow * self.scale.rate), round(LEG / 4 * RATE)
        mute = {"mute": count - 1, "mute_patience": 3 * heartbeat + REACTION}
        _, end = self.play(self._job([way] * count, od.PROFILE_VELOCITY) | mute)
        if not end["reacted"]:
            raise DriveError(
                "the drive moved on when the heartbeat fell silent; check 1016h, 1029h and 6007h"
            )

    def keeps_speed_limit(self, peak: float) -> None:
        """Torque up to `peak` (N m) against a low limit of speed. Raises DriveError."""
        slow, way = self.slow, self._inward()
        both = (od.MAX_PROFILE_VELOCITY, od.MAX_MOTOR_SPEED)
        had = {item: value for item in both if (value := present(self.drive, item)) is not None}
        ramp = np.append(
            np.linspace(0, peak, round(LEG / 2 * RATE)), np.full(round(HOLD * RATE), peak)
        )
        job = self._job(np.rint(way * ramp * self.scale.torque), od.PROFILE_TORQUE)
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
        """To a position of the drive: fast first, where that is wanted, then slowly."""
        for rate in (FAST * self.limits.rate, self.slow) if fast else (self.slow,):
            way = position - self.drive.read(od.POSITION)
            count = round(abs(way / self.scale.position) / rate * RATE)
            if count > LONGEST * RATE:
                raise DriveError(
                    f"the way to the start angle takes {count / RATE:.3g} s at {rate:.3g} rad/s; "
                    f"turn the load nearer, at most {LONGEST:g} s are allowed"
                )
            raw = math.copysign(rate * abs(self.scale.rate), way)
            if count > CLOSE:
                self._rate([round(raw)] * count + [0] * round(LEG / 10 * RATE))

    def _inward(self) -> int:
        """The sign of a motion toward zero."""
        return 1 if self.drive.read(od.POSITION) * self.scale.position <= 0 else -1

    def _rate(self, targets: list[int]) -> np.ndarray:
        return self.play(self._job(targets, od.PROFILE_VELOCITY))[0]

    def _job(self, targets: Any, mode: int) -> dict[str, Any]:
        return {"mode": mode, "targets": [int(each) for each in targets], "period": 1 / RATE}
