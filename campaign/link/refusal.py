"""Refusal of plans that no controller can execute, before a connection."""

from __future__ import annotations

from typing import Any

from campaign.trial import Trial, leaves

COMMANDED = ("controller", "compensation", "limits")
"""The tables of a bench that are sent to its controller; the others describe the plant."""
WORDS = ("name", "description", "known")
"""Descriptive fields of a bench."""
_ABSENT = "absent"


class Refusal:
    """Check whether a real bench can execute a trial; call it for all trials of a plan in order.

    Between trials, a real plant may differ only in fields that the operator sets according to the
    trial; they stay until the operator sets them again.
    """

    def __init__(
        self,
        *,
        base_motion: bool,
        remedy: str = "`--set backend.motion=emulated` has a rehearsal controller emulate one",
    ) -> None:
        """`base_motion`: whether a device moves the hull; `remedy`: how to provide one."""
        self._base_motion = base_motion
        self._remedy = remedy
        self._plants: dict[str, dict[str, Any]] = {}  # by the name of the bench
        self._trials: dict[str, str] = {}  # the trial that last had it

    def __call__(self, trial: Trial) -> str | None:
        """Reason with the field; None if the bench can execute the trial."""
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
            for path, value in leaves(trial.bench, "bench.")
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
