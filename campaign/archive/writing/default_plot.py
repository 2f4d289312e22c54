"""The default plot of a run and of a trial in HDF5 viewers.

One channel, and others only if they have its unit: a plot of many units on one axis is useless.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from campaign.archive.layout.header import PlannedTrial
from campaign.channels import (
    DRIVE_TORQUE,
    FRICTION_TORQUE,
    GYRO_RATE,
    POINTING_ERROR,
    RELATIVE_RATE,
)
from campaign.recording import ChannelInfo
from campaign.trial import Role, Task, Tree

BY_MODE = {
    "rate": GYRO_RATE,
    "torque": RELATIVE_RATE,
    "prescribed": FRICTION_TORQUE,
    "spring": RELATIVE_RATE,
}
"""Default channel by the mode of a task."""


@dataclass(frozen=True)
class Aim:
    """Properties of a trial that select its default channel.

    Attributes:
        mode: mode of its task.
        hull_moves: whether the task has a base motion.
        requires: the channels that its analysis requires.
    """

    mode: str
    hull_moves: bool = False
    requires: tuple[str, ...] = ()

    @classmethod
    def of(cls, task: Task, requires: Iterable[str]) -> Self:
        return cls(task.mode, task.base_acceleration.shape != "zero", tuple(requires))

    @classmethod
    def of_tree(cls, trial: Tree) -> Self:
        """Aim of an archived trial; without a base motion in it, the hull is at rest."""
        task, requires = trial.get("task"), trial.get("requires")
        task = task if isinstance(task, Mapping) else {}
        motion = task.get("base_acceleration")
        shape = motion.get("shape", "zero") if isinstance(motion, Mapping) else "zero"
        names = requires if isinstance(requires, list) else ()
        return cls(str(task.get("mode", "")), shape != "zero", tuple(map(str, names)))

    def channel(self, names: Sequence[str]) -> str:
        """The channel to plot first; `names` are the recorded channels, at least one.

        If the hull moves, it is the pointing error, the measure of stabilization. At a commanded
        rate it is the drive torque (the friction), if the analysis requires it. Otherwise it is the
        channel of the mode, or the first one.
        """
        wanted = [POINTING_ERROR] if self.hull_moves else []
        if self.mode == "rate" and DRIVE_TORQUE in self.requires:
            wanted.append(DRIVE_TORQUE)
        wanted.append(BY_MODE.get(self.mode, ""))
        return next((name for name in wanted if name in names), names[0])

    def accepted(self, names: Sequence[str]) -> frozenset[str]:
        """The valid default channels; older programs selected by the mode only."""
        return frozenset((self.channel(names), Aim(self.mode).channel(names)))


def beside(shown: ChannelInfo, channels: Iterable[ChannelInfo]) -> list[str]:
    """The other channels with the same unit and display unit, for the same axis."""
    units = shown.unit, shown.display_unit
    same = (each.name for each in channels if (each.unit, each.display_unit) == units)
    return [name for name in same if name != shown.name]


def leading_trial(
    plan: Iterable[PlannedTrial], completed: Collection[int], with_samples: Sequence[int]
) -> int | None:
    """Number of the trial that viewers open first.

    It is the middle one of the completed measurements of the first test that has any: the first
    and last trials of a map are its slowest and fastest points. Without any it is the first trial
    with samples, of any outcome.

    Args:
        plan: every trial in order, follow-up trials included.
        completed: numbers of the completed trials.
        with_samples: numbers of the trials that have samples in the file.
    """
    good = set(completed) & set(with_samples)
    measured = [each for each in plan if each.number in good and each.role is Role.MEASUREMENT]
    if not measured:
        return next(iter(with_samples), None)
    first = [each.number for each in measured if each.test == measured[0].test]
    return first[(len(first) - 1) // 2]
