"""Preload of the anti-backlash gear, and its friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from campaign.options import Options
from campaign.physics.friction import model_of
from campaign.physics.friction_paths import (
    INTERFACE,
    Wrong,
    changeable,
    choices,
    matched,
    nested,
    split,
    torques,
    why_not,
    without,
)
from campaign.units import Torque, torque_text

SLOWEST = 1e-9
"""rad/s; friction at this rate is that of the onset of sliding, and the breakaway torque of an
interface without static torque."""

Share = Annotated[float, Field(ge=0, le=2)]


def _kind(value: Any) -> str:
    """Tag of a value: a share, or the table of one interface."""
    return INTERFACE if isinstance(value, Mapping) else "share"


Shares = Annotated[
    dict[
        str,
        Annotated[
            Annotated[Share, Tag("share")] | Annotated[dict[str, Share], Tag(INTERFACE)],
            Discriminator(_kind),
        ],
    ],
    BeforeValidator(nested),
]


class PreloadOptions(Options):
    """Preload of the anti-backlash gear, expressed as breakaway torque."""

    torque: Torque = Field(gt=0)
    """Breakaway torque of the axis with the present preload."""
    nominal: Torque = Field(gt=0)
    """Breakaway torque of the axis with the friction parameters of this bench."""
    shares: Shares = {"static_torque": 1.0}
    """Share of the difference that is added to a torque, seen at the load, by its path:
    `static_torque` of all preloaded interfaces together, or `mesh.static_torque`."""

    @property
    def by_path(self) -> dict[str, float]:
        """Share by dotted path."""
        flat: dict[str, float] = {}
        for key, value in self.shares.items():
            if isinstance(value, Mapping):
                flat |= {f"{key}.{name}": share for name, share in value.items()}
            else:
                flat[key] = value
        return flat


def wrong_shares(preload: PreloadOptions, friction: Mapping[str, Any]) -> Iterator[Wrong]:
    """Paths without a torque that this preload can raise.

    Without a preloaded interface there are none: the preload has no effect.
    """
    declared = {name: torques(options) for name, options in _loaded(friction).items()}
    for path in preload.by_path if declared else ():
        interface, parameter = split(path)
        message = why_not(path, declared, "that is a torque")
        if interface in friction and interface not in declared:
            message = f"friction.{interface} is not preloaded; {choices(interface, declared)}"
        keys = ("shares", parameter) if "." not in path else ("shares", interface, parameter)
        if message:
            yield Wrong(keys, message)


def loading(preload: PreloadOptions, friction: Mapping[str, Any]) -> PreloadOptions:
    """`preload` without the shares that match nothing in this friction."""
    tree = preload.model_dump(mode="json")
    for wrong in wrong_shares(preload, friction):
        tree = {"shares": {}, **without(tree, wrong.keys)}
    return PreloadOptions.model_validate(tree, context={"si": True})


def with_preload(
    friction: Mapping[str, Any], ratio: float, preload: PreloadOptions | None
) -> dict[str, Any]:
    """Friction options by interface, changed from nominal by `preload`.

    The axis gains the torque of each share. The interfaces of its path divide it in proportion to
    their breakaway torques at the load. `ratio`: of the gear. Raises ValueError, with a message for
    the user, if no friction would remain.
    """
    if preload is None or preload.torque == preload.nominal:
        return dict(friction)
    loaded = _loaded(friction)
    declared = {name: torques(options) for name, options in loaded.items()}
    ratios = {name: options.at_load(ratio)[0] for name, options in loaded.items()}
    added: dict[str, dict[str, float]] = {name: {} for name in loaded}
    for path, share in preload.by_path.items():
        gaining = dict(matched(path, declared))
        at_load = {name: _breakaway(loaded[name]) * ratios[name] for name in gaining}
        whole = sum(at_load.values())
        for name, parameter in gaining.items():
            part = at_load[name] / whole if whole > 0 else 1.0 / len(gaining)
            extra = part / ratios[name] * (preload.torque - preload.nominal)
            added[name][parameter] = added[name].get(parameter, 0.0) + share * extra
    raised = {name: _raised(name, loaded[name], added[name], preload.torque) for name in loaded}
    return {name: raised.get(name, options) for name, options in friction.items()}


def _loaded(friction: Mapping[str, Any]) -> dict[str, Any]:
    return {name: options for name, options in friction.items() if options.preloaded}


def _breakaway(options: Any) -> float:
    """Breakaway torque of an interface (N m at the interface)."""
    if "static_torque" in torques(options):
        return float(options.static_torque)
    steady = model_of(options).steady_state(options, np.array([SLOWEST]))
    return abs(float(steady[0]))


def _raised(name: str, options: Any, added: Mapping[str, float], torque: float) -> Any:
    """One interface with its torques changed by `added` (N m at the interface)."""

    def more(parameter: str, value: float) -> float:
        raised = value + added.get(parameter, 0.0)
        if raised <= 0 < value:
            raise ValueError(
                f"a preload of {torque_text(torque, 'g')} leaves friction.{name} with a "
                f"{parameter} of {torque_text(raised, '.4g')}; raise preload.torque or lower its "
                "share"
            )
        return raised

    return changed(options, more)


def changed(options: Any, change: Callable[[str, float], float]) -> Any:
    """Friction options with all changeable parameters changed, in both directions."""
    names = changeable(options)

    def own(of: Any) -> dict[str, float]:
        values = {name: getattr(of, name, None) for name in names}
        return {name: change(name, value) for name, value in values.items() if value is not None}

    update: dict[str, Any] = own(options)
    negative = getattr(options, "negative", None)
    if negative is not None:
        update["negative"] = negative.model_copy(update=own(negative))
    return options.model_copy(update=update)
