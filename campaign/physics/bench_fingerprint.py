"""Fingerprint of a bench: a hash of the SI values that affect motion.

The hash excludes names, comments, limits and uncertainties. It also excludes values that are
absent, off or at their default, so that a new optional field changes no hash. Each compensation
has its own hash, so that an additional one changes no other. The values at the bench's `operating`
paths are excluded, but the list of these paths is included. So is the list of published cells from
which the bench was made: without one of them it is another bench.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import FingerprintOptions
from campaign.physics.friction.interface import Ripple
from campaign.physics.scatter import VariationOptions
from campaign.trial import canonical_json

DIGITS = 12
"""Significant digits in the hash: the same value in another unit differs in the last bits."""
NOT_MOTION = frozenset(
    {("name",), ("description",), ("known",), ("limits",), ("compensation",), ("axis", "name")}
)
"""Fields without effect on motion; compensations have separate hashes."""
STATED = ("given", "fitted", "seen", "operating")
"""Lists of `known` that the hash includes, in any order, unless they are empty."""


def fingerprint(bench: Bench) -> FingerprintOptions:
    """Fingerprint of a bench and of each of its compensations."""
    operating = frozenset(tuple(path.split(".")) for path in bench.known.operating)
    acting = {"bench": _acting(bench, (), NOT_MOTION | operating)}
    for name in STATED:
        if entries := getattr(bench.known, name):
            acting[name] = sorted(set(entries))
    return FingerprintOptions(
        bench=_hash(acting),
        compensation={
            name: _hash(_acting(options, ("compensation", name), operating))
            for name, options in bench.compensation.items()
        },
    )


def why_altered(bench: Bench, compensation: str = "none") -> str:
    """Why this bench is not the one that its `known` describes; "" if it is, or `known` is empty.

    Args:
        compensation: name of the active compensation; the others are not checked.
    """
    if not bench.known.describes:
        return ""
    stated = bench.known.fingerprint
    if stated is None:
        return f"the bench '{bench.name}' states no fingerprint of the bench that was described"
    now = fingerprint(bench)
    if now.bench != stated.bench:
        return f"the bench is not the '{bench.name}' that was described"
    if compensation == "none" or compensation not in now.compensation:
        return ""
    if compensation not in stated.compensation:
        return f"the compensation '{compensation}' was not there when '{bench.name}' was described"
    if now.compensation[compensation] != stated.compensation[compensation]:
        return f"the compensation '{compensation}' is not the one of '{bench.name}' as described"
    return ""


def _acting(options: BaseModel, keys: tuple[str, ...], without: frozenset[tuple[str, ...]]) -> Any:
    """Values of a table that differ from their defaults, without the paths `without`."""
    if _is_off(options):
        return {}
    acting: dict[str, Any] = {}
    for name, field in type(options).model_fields.items():
        value, path = getattr(options, name), (*keys, name)
        default = field.get_default(call_default_factory=True, validated_data={})
        at_default = default is not PydanticUndefined and value == default
        if path in without or value is None or at_default:
            continue
        plain = _plain(value, path, without)
        if plain != {} and plain != []:
            acting[name] = plain
    return acting


def _plain(value: Any, keys: tuple[str, ...], without: frozenset[tuple[str, ...]]) -> Any:
    if isinstance(value, BaseModel):
        return _acting(value, keys, without)
    if isinstance(value, Mapping):
        inside = {
            str(key): _plain(item, (*keys, str(key)), without)
            for key, item in value.items()
            if (*keys, str(key)) not in without
        }
        return {key: item for key, item in inside.items() if item != {}}
    if isinstance(value, list | tuple):
        return [_plain(item, keys, without) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") + 0.0  # -0 is 0
    return value if isinstance(value, bool | int) else str(value)


def _is_off(options: BaseModel) -> bool:
    """Whether a table is present but has no effect."""
    if isinstance(options, Ripple):
        return options.amplitude == 0.0
    if isinstance(options, VariationOptions):
        return not options.day_to_day and not options.trial_to_trial
    return False


def _hash(acting: Any) -> str:
    return hashlib.sha256(canonical_json(acting).encode()).hexdigest()[:16]
