"""Which of several axes each column of a file is of, by what its name says besides its role."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    JOINT_TORQUE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)

_OF_AN_AXIS = frozenset(
    {
        *(RELATIVE_ANGLE, RELATIVE_RATE, MOTOR_ANGLE, MOTOR_RATE, DRIVE_TORQUE, JOINT_TORQUE),
        *(MOTOR_CURRENT, REFERENCE, COMMAND),
    }
)
"""A rig may well have two thermometers; of these an axis has one."""
_TWO = 2
"""Quantities that words have to repeat: of `encoder left`, `encoder right` one alone is no axis."""


def axes(columns: Sequence[tuple[str, tuple[str, ...]]]) -> list[str]:
    """The axis of each column, given its role and its tag (`Named.tag`); "" of those of all.

    Numbers name axes where a quantity of an axis has several of them: `q1`, `q2`; so do the letters
    x, y and z. Words do where
    two quantities have the same ones: `shoulder` and `elbow` with an angle and a rate each.
    """
    moving = [Counter(tag) for role, tag in columns if role in _OF_AN_AXIS]
    common = moving[0] if moving else Counter[str]()
    for tag in moving[1:]:
        common &= tag
    keys = [" ".join((Counter(tag) - common).elements()) for _, tag in columns]
    keys = _by_number(columns, keys)
    of_role: dict[str, set[str]] = {}
    for (role, _), key in zip(columns, keys, strict=True):
        if role in _OF_AN_AXIS and key:
            of_role.setdefault(role, set()).add(key)
    found = {
        key
        for own in of_role.values()
        if len(numbered := {key for key in own if _has_number(key)}) > 1
        for key in numbered
    }
    repeated = Counter(key for own in of_role.values() for key in own if not _has_number(key))
    words = {key for key, count in repeated.items() if count >= _TWO}
    if len(words) > 1:
        found |= words
    return [
        key if key in found else _within(tag, found)
        for (_, tag), key in zip(columns, keys, strict=True)
    ]


def _by_number(columns: Sequence[tuple[str, tuple[str, ...]]], keys: list[str]) -> list[str]:
    """Keys without the words beside a number, where the numbers alone tell columns apart as well.

    `observations.q(:,1)` and `action(:,1)` are of one axis.
    """
    bare = [" ".join(filter(str.isdigit, key.split())) or key for key in keys]
    roles = [role if role in _OF_AN_AXIS else "" for role, _ in columns]
    apart = {(role, key) for role, key in zip(roles, keys, strict=True) if role}
    alike = {(role, key) for role, key in zip(roles, bare, strict=True) if role}
    return bare if len(apart) == len(alike) else keys


def _within(tag: Sequence[str], found: Collection[str]) -> str:
    """The one axis whose words are all in a tag that has others as well; "" where none is."""
    among = [key for key in found if set(key.split()) <= set(tag)]
    return among[0] if len(among) == 1 else ""


def _has_number(key: str) -> bool:
    """Whether it is counted; the axes of a machine are, by their letters."""
    return any(word.isdigit() or word in ("x", "y", "z") for word in key.split())
