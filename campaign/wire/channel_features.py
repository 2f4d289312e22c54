"""Channels named among a device's features: `channel:gyro_rate`."""

from __future__ import annotations

from collections.abc import Iterable

CHANNEL = "channel:"


def channel_features(names: Iterable[str]) -> tuple[str, ...]:
    """The words of CAPABILITIES for channels that every trial of a device records."""
    return tuple(f"{CHANNEL}{name}" for name in names)


def named_channels(features: Iterable[str]) -> frozenset[str] | None:
    """The channels that `features` name; None when they name none: it will not say before ARM."""
    named = frozenset(word.removeprefix(CHANNEL) for word in features if word.startswith(CHANNEL))
    return named or None
