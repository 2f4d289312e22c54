"""Channels as features of a device: `channel:gyro_rate`."""

from __future__ import annotations

from collections.abc import Iterable

CHANNEL = "channel:"


def channel_features(names: Iterable[str]) -> tuple[str, ...]:
    """Features in CAPABILITIES for the channels that every trial of a device records."""
    return tuple(f"{CHANNEL}{name}" for name in names)


def named_channels(features: Iterable[str]) -> frozenset[str] | None:
    """The channels in `features`; None if there are none: then only ARM returns the channels."""
    named = frozenset(word.removeprefix(CHANNEL) for word in features if word.startswith(CHANNEL))
    return named or None
