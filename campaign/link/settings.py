"""Settings of a controller for a trial, and those it rejects."""

from __future__ import annotations

from campaign.link.errors import RefusedError
from campaign.trial import Trial
from campaign.wire.configuration import REHEARSAL, configuration_of
from campaign.wire.messages import Capabilities, Value


def settings_of(
    trial: Trial, capabilities: Capabilities | None, *, emulated: bool
) -> dict[str, Value]:
    """Every setting of `trial` for the controller with these `capabilities`, by name.

    `emulated`: whether the controller must emulate the hull's motion. Raises RefusedError if that
    controller cannot do it; with unknown capabilities (None), the controller may refuse it itself.
    """
    settings = configuration_of(trial)
    if capabilities is None or REHEARSAL not in capabilities.features:
        if emulated and trial.task.base_acceleration.shape != "zero":
            raise RefusedError(
                "task.base_acceleration: only a rehearsal controller can emulate the hull"
            )
        ours = f"{REHEARSAL}."
        settings = {name: value for name, value in settings.items() if not name.startswith(ours)}
    if capabilities is not None:
        _check_lengths(settings, capabilities.longest_array)
    return settings


def _check_lengths(settings: dict[str, Value], most: int) -> None:
    for name, value in settings.items():
        if isinstance(value, tuple) and len(value) > most:
            raise RefusedError(
                f"{name} has {len(value)} values, and the controller takes {most} at most: ask for "
                "a shorter command, or for one of lower frequencies"
            )
