"""The truth: a simulated bench that differs from the stated bench.

Plan and analysis use the stated bench. Its controller, compensation and limits are software. They
act on the truth as on a rig: with the stated inertia and torque constant. Axis, appendage, motor,
gear, friction, scatter and sensors are those of the truth.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.friction_paths import Keys
from campaign.trial import Tree, canonical_json

SOFTWARE = ("controller", "compensation", "limits")
"""Tables that always come from the stated bench; those of the truth are not used."""
PROSE = ("name", "description", "given", "fitted", "known")
"""Tables without effect on motion."""


def plant_of(truth: Bench) -> Tree:
    """The part of a truth that a simulation uses, normalised (SI): all but `SOFTWARE`."""
    # `known` is about the stated bench; some of its paths are in tables that a plant lacks.
    return truth.model_dump(mode="json", exclude={*SOFTWARE, "known"})


def simulated(plant: Tree, stated: Bench) -> CompleteBench:
    """The simulated bench: the plant of a truth with the software of `stated`.

    Raises ValueError if they are incompatible.
    """
    software = stated.model_dump(mode="json", include=set(SOFTWARE))
    truth = Bench.model_validate({**plant, **software}, context={"si": True})
    if truth.gear and stated.gear and truth.gear.ratio != stated.gear.ratio:
        raise ValueError(
            f"the gear ratio of the truth is {truth.gear.ratio:g}, the stated one "
            f"{stated.gear.ratio:g}; teeth are counted: write the same in both"
        )
    complete(stated)  # the software uses its inertia and torque constant
    return complete(truth)


def digest(plant: Tree) -> str:
    """SHA-256 of a plant; a trial contains no other information on its truth."""
    return hashlib.sha256(canonical_json(plant).encode()).hexdigest()


def is_setting(keys: Keys) -> bool:
    """Whether a value at this path is a setting of the rig itself, and thus of the truth too."""
    return keys[0] not in (*SOFTWARE, *PROSE)


def settings(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[Keys, Any]:
    """Settings of the rig that differ between the normalised benches `before` and `after`."""
    return {keys: value for keys, value in _differing(before, after) if is_setting(keys)}


def value_at(tree: Any, keys: Keys) -> Any:
    """Value at a path. Raises LookupError."""
    for key in keys:
        tree = tree[key]
    return tree


def has(plant: Tree, keys: Keys) -> bool:
    """Whether the plant has a value at that path."""
    try:
        value_at(plant, keys)
    except (LookupError, TypeError):
        return False
    return True


def with_settings(plant: Tree, turned: Mapping[Keys, Any]) -> Tree:
    """The plant with the rig's settings, at the same paths and with the same values (SI).

    Raises ValueError for a path that the plant lacks: a sweep over it would change the stated bench
    only.
    """
    changed: Tree = plant
    for keys, value in turned.items():
        if not has(changed, keys):
            raise ValueError(
                f"the truth has no '{'.'.join(map(str, keys))}': what is changed there would be "
                "changed in the stated bench alone"
            )
        changed = _put(changed, keys, value)
    return changed


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
