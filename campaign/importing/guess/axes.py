"""Which of several axes each column of a file is of, by what its name says besides its role."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from campaign.importing.guess.columns import ColumnGuess

_OF_A_RIG = ("temperature", "normal_load", "gyro_rate", "base_rate")
"""Channels that a rig may well have two of, without a second axis."""


def axes(columns: Sequence[ColumnGuess]) -> list[str]:
    """The axis of each column; "" of those of all.

    Numbers, and the letters x, y and z, name axes where a role has several of them: `q1`, `q2`.
    Words do where two roles have the same ones: `shoulder` and `elbow` with an angle and a rate
    each; of `encoder left` and `encoder right` one alone is no axis.
    """
    moving = [each for each in columns if each.is_channel and each.role not in _OF_A_RIG]
    common = set(moving[0].tag).intersection(*(each.tag for each in moving)) if moving else set()
    keys = [_key(each.tag, common) for each in columns]
    of = {(each.role, _key(each.tag, common)) for each in moving}
    numbered = Counter(role for role, key in of if _is_number(key))
    roles = Counter(key for _, key in of if key and not _is_number(key))
    found = {key for role, key in of if _is_number(key) and numbered[role] > 1}
    words = {key for key, count in roles.items() if count > 1}
    found |= words if len(words) > 1 else set()
    return [key if key in found else "" for key in keys]


def _key(tag: Sequence[str], common: set[str]) -> str:
    """Numbers and letters of a machine's axes, or else the words, that not all columns have."""
    own = [word for word in tag if word not in common]
    return " ".join(filter(_is_number, own)) or " ".join(own)


def _is_number(key: str) -> bool:
    return bool(key) and all(word.isdigit() or word in ("x", "y", "z") for word in key.split())
