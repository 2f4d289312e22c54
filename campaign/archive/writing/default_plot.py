"""The default plot of a run and of a trial in HDF5 viewers.

One channel, and beside it only those that fit on its axis: eleven units on one axis tell nothing.
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
"""By a task's mode, the channel that tells most where nothing else says which."""


@dataclass(frozen=True)
class Aim:
    """What of a trial decides which of its channels tells most.

    Attributes:
        mode: of its task.
        hull_moves: whether the task has a base motion.
        requires: the channels without which its analysis finds nothing.
    """

    mode: str
    hull_moves: bool = False
    requires: tuple[str, ...] = ()

    @classmethod
    def of(cls, task: Task, requires: Iterable[str]) -> Self:
        return cls(task.mode, task.base_acceleration.shape != "zero", tuple(requires))

    @classmethod
    def of_tree(cls, trial: Tree) -> Self:
        """The same of an archived trial; one that does not say so moves no hull."""
        task, requires = trial.get("task"), trial.get("requires")
        task = task if isinstance(task, Mapping) else {}
        motion = task.get("base_acceleration")
        shape = motion.get("shape", "zero") if isinstance(motion, Mapping) else "zero"
        names = requires if isinstance(requires, list) else ()
        return cls(str(task.get("mode", "")), shape != "zero", tuple(map(str, names)))

    def channel(self, names: Sequence[str]) -> str:
        """Of the channels that were recorded, at least one, the one to plot first.

        Where the hull moves it is the pointing error, which stabilizing is about; at a commanded
        rate the drive torque, if that is what the analysis needs: it is the friction. Else it is
        that of the mode, or the first there is.
        """
        wanted = [POINTING_ERROR] if self.hull_moves else []
        if self.mode == "rate" and DRIVE_TORQUE in self.requires:
            wanted.append(DRIVE_TORQUE)
        wanted.append(BY_MODE.get(self.mode, ""))
        return next((name for name in wanted if name in names), names[0])

    def accepted(self, names: Sequence[str]) -> frozenset[str]:
        """The channels that may be plotted first: before, the mode alone decided."""
        return frozenset((self.channel(names), Aim(self.mode).channel(names)))


def beside(shown: ChannelInfo, channels: Iterable[ChannelInfo]) -> list[str]:
    """The other channels that fit on its axis: of its unit, as files and as readers have it."""
    units = shown.unit, shown.display_unit
    same = (each.name for each in channels if (each.unit, each.display_unit) == units)
    return [name for name in same if name != shown.name]


def telling_trial(
    plan: Iterable[PlannedTrial], completed: Collection[int], with_samples: Sequence[int]
) -> int | None:
    """Number of the trial that a run opens on.

    It is the middle one of the completed measurements of the first test that has any: the first of
    a map is its slowest point, the last its fastest. Without any it is the first trial with
    samples, whatever became of it.

    Args:
        plan: every trial, those that followed included, in order.
        completed: numbers of the trials that ran to their end.
        with_samples: numbers of the trials that have samples in the file.
    """
    good = set(completed) & set(with_samples)
    measured = [each for each in plan if each.number in good and each.role is Role.MEASUREMENT]
    if not measured:
        return next(iter(with_samples), None)
    first = [each.number for each in measured if each.test == measured[0].test]
    return first[(len(first) - 1) // 2]
