"""The preload of the anti-backlash gear, and the friction it adds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import Field

from campaign.options import Options
from campaign.units import Torque

PARAMETERS = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "viscous_friction",
    "bristle_stiffness",
)


class PreloadOptions(Options):
    """The preload of the anti-backlash gear, told by the breakaway torque it leads to."""

    torque: Torque = Field(gt=0)
    """Breakaway torque of the axis as the gear is preloaded now."""
    nominal: Torque = Field(gt=0)
    """Breakaway torque that the friction parameters of this bench belong to."""
    static_share: float = Field(default=1.0, ge=0, le=2)
    """Share of the difference that static friction gains."""
    coulomb_share: float = Field(default=0.0, ge=0, le=2)
    """Share of the difference that Coulomb friction gains."""


def with_preload(
    friction: Mapping[str, Any], ratio: float, preload: PreloadOptions | None
) -> dict[str, Any]:
    """Friction options by interface, with what `preload` adds to (or takes from) the nominal ones.

    The axis gains what the preload says; interfaces share it as they share the static torque of
    the axis. `ratio` is that of the gear. Raises ValueError, with a message for the user, where no
    friction would be left.
    """
    if preload is None or preload.torque == preload.nominal:
        return dict(friction)
    loaded = {name: f for name, f in friction.items() if f.preloaded}
    ratios = {name: ratio if f.side == "motor" else 1.0 for name, f in loaded.items()}
    at_load = {name: getattr(f, "static_torque", 0.0) * ratios[name] for name, f in loaded.items()}
    whole = sum(at_load.values())
    raised = dict(friction)
    for name, options in loaded.items():
        share = at_load[name] / whole if whole > 0 else 1.0 / len(loaded)
        raised[name] = _raised(name, options, preload, share / ratios[name])
    return raised


def _raised(name: str, options: Any, preload: PreloadOptions, share: float) -> Any:
    """One interface with its `share` of what the preload adds (N m at the interface)."""
    extra = share * (preload.torque - preload.nominal)
    added = {
        "static_torque": preload.static_share * extra,
        "coulomb_torque": preload.coulomb_share * extra,
    }

    def more(parameter: str, value: float) -> float:
        raised = value + added.get(parameter, 0.0)
        if raised <= 0 < value:
            raise ValueError(
                f"a preload of {preload.torque:g} N m leaves friction.{name} with a "
                f"{parameter} of {raised:.4g} N m; raise preload.torque or lower its share"
            )
        return raised

    return changed(options, more)


def changed(options: Any, change: Callable[[str, float], float]) -> Any:
    """Friction options with the parameters that scatter or grow changed, in both directions."""

    def own(of: Any) -> dict[str, float]:
        values = {name: getattr(of, name, None) for name in PARAMETERS}
        return {name: change(name, value) for name, value in values.items() if value is not None}

    update: dict[str, Any] = own(options)
    negative = getattr(options, "negative", None)
    if negative is not None:
        update["negative"] = negative.model_copy(update=own(negative))
    return options.model_copy(update=update)
