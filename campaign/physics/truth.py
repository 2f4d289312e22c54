"""The simulated bench where it differs from the stated one.

Whoever plans and analyses a trial knows the stated bench. Its controller, compensation and limits
are software, and act on the truth as they act on a rig: with the stated inertia, the stated torque
constant. Axis, appendage, motor, gear, friction, scatter and sensors are the truth's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.trial import Tree, canonical_json

Keys = tuple[str | int, ...]

SOFTWARE = ("controller", "compensation", "limits")
"""Tables of a bench that are always the stated one's; what a truth has there is not used."""
PROSE = ("name", "description", "given", "fitted", "known")
"""What moves nothing."""


def plant_of(truth: Bench) -> Tree:
    """What a truth brings to a simulation, normalised (SI): all but `SOFTWARE`."""
    # What is known of a bench is said of the stated one, of whose tables some are not here.
    return truth.model_dump(mode="json", exclude={*SOFTWARE, "known"})


def simulated(plant: Tree, stated: Bench) -> CompleteBench:
    """The bench that is simulated: the plant of a truth under the software of `stated`.

    Raises ValueError when they do not go together.
    """
    software = stated.model_dump(mode="json", include=set(SOFTWARE))
    truth = Bench.model_validate({**plant, **software}, context={"si": True})
    if truth.gear and stated.gear and truth.gear.ratio != stated.gear.ratio:
        raise ValueError(
            f"the gear ratio of the truth is {truth.gear.ratio:g}, the stated one "
            f"{stated.gear.ratio:g}; teeth are counted: write the same in both"
        )
    complete(stated)  # its inertia and torque constant are what software reckons with
    return complete(truth)


def digest(plant: Tree) -> str:
    """SHA-256 of a plant: all that a trial says of its truth."""
    return hashlib.sha256(canonical_json(plant).encode()).hexdigest()


def is_setting(keys: Keys) -> bool:
    """Whether a value at this path of a bench is turned at the rig itself, so at the truth, too."""
    return keys[0] not in (*SOFTWARE, *PROSE)


def settings(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[Keys, Any]:
    """What somebody turned at the rig who made the normalised bench `after` of `before`."""
    return {keys: value for keys, value in _differing(before, after) if is_setting(keys)}


def value_at(tree: Any, keys: Keys) -> Any:
    """What stands at a path. Raises LookupError."""
    for key in keys:
        tree = tree[key]
    return tree


def has(plant: Tree, keys: Keys) -> bool:
    """Whether the plant has something at that path."""
    try:
        value_at(plant, keys)
    except (LookupError, TypeError):
        return False
    return True


def with_settings(plant: Tree, turned: Mapping[Keys, Any]) -> Tree:
    """The plant with what was turned at the rig, at the same paths and to the same values (SI).

    Raises ValueError for a path that it does not have: a sweep over it would change what is
    believed of the bench, and not the bench.
    """
    found: Tree = plant
    for keys, value in turned.items():
        if not has(found, keys):
            raise ValueError(
                f"the truth has no '{'.'.join(map(str, keys))}': what is changed there would be "
                "changed in the stated bench alone"
            )
        found = _put(found, keys, value)
    return found


def _differing(
    before: Mapping[str, Any], after: Mapping[str, Any], above: Keys = ()
) -> Iterator[tuple[Keys, Any]]:
    for key in after:
        was, now = before.get(key), after[key]
        if isinstance(was, Mapping) and isinstance(now, Mapping) and was.keys() == now.keys():
            yield from _differing(was, now, (*above, key))
        elif canonical_json(was) != canonical_json(now):
            yield (*above, key), now


def _put(tree: Mapping[str, Any], keys: Keys, value: Any) -> dict[str, Any]:
    key = str(keys[0])
    below = value if len(keys) == 1 else _put(tree[key], keys[1:], value)
    return {**tree, key: below}
