"""Plans that no controller can execute, refused before a connection."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from campaign.trial import Tree, Trial

COMMANDED = ("controller", "compensation", "limits")
"""The tables of a bench that its controller is told; the others describe the plant."""
WORDS = ("name", "description", "known")
"""What a bench says about itself."""
_ABSENT = "absent"


class Refusal:
    """Why a real bench cannot execute a trial; asked of all trials of a plan, in order.

    A real plant is what it is. It may differ from one trial to the next only in what the trial says
    a person sets, and it stays that way until a person sets it again.
    """

    def __init__(
        self,
        *,
        base_motion: bool,
        remedy: str = "`--set backend.motion=emulated` has a rehearsal controller emulate one",
    ) -> None:
        """`base_motion`: whether a device moves the hull; `remedy`: how there would be one."""
        self._base_motion = base_motion
        self._remedy = remedy
        self._plants: dict[str, dict[str, Any]] = {}  # by the name of the bench
        self._trials: dict[str, str] = {}  # the trial that last had it

    def __call__(self, trial: Trial) -> str | None:
        """Naming the field; None when it can be executed."""
        return self._of_task(trial) or self._of_sweep(trial) or self._of_plant(trial)

    def _of_task(self, trial: Trial) -> str | None:
        task = trial.task
        if task.mode in ("prescribed", "spring"):
            return (
                f"task.mode = {task.mode!r} moves the load without its motor, which only a "
                "simulated bench can"
            )
        if task.disturbance.shape != "zero":
            return "task.disturbance: only a simulated bench can be pushed from outside"
        if task.base_acceleration.shape != "zero" and not self._base_motion:
            return f"task.base_acceleration: there is no device that moves the hull; {self._remedy}"
        return None

    def _of_sweep(self, trial: Trial) -> str | None:
        for path in trial.point:
            if _is_plant(path) and path not in trial.set_by_operator:
                return _nobody_sets(path, "is swept")
        return None

    def _of_plant(self, trial: Trial) -> str | None:
        name = str(trial.bench.get("name", ""))
        plant = {
            path: value
            for path, value in _leaves(trial.bench, "bench.")
            if path.split(".")[1] not in (*COMMANDED, *WORDS)
        }
        before, where = self._plants.get(name, plant), self._trials.get(name, "")
        for path in sorted(before.keys() | plant.keys()):
            was, now = before.get(path, _ABSENT), plant.get(path, _ABSENT)
            if was != now and path not in trial.set_by_operator:
                return _nobody_sets(path, f"is {now}, after {was} in {where}")
        self._plants[name], self._trials[name] = plant, trial.name
        return None


def _is_plant(path: str) -> bool:
    first, _, rest = path.partition(".")
    return first == "bench" and bool(rest) and rest.partition(".")[0] not in COMMANDED


def _nobody_sets(path: str, what: str) -> str:
    return (
        f"{path} {what}, but it belongs to the bench itself and no controller can set it; "
        "name it in `sets` of a [[test.operator]] if a person does, or use the backend sim"
    )


def _leaves(tree: Tree | Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
