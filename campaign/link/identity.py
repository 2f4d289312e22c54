"""The identity of a host, stored and reported by a controller."""

from __future__ import annotations

import getpass
import os
import platform
import random

from campaign.plain_text import printable
from campaign.wire.fields import clipped

LONGEST = 120
"""Largest size (bytes of UTF-8); a controller may have little memory."""


def new_session() -> int:
    """A random session number of a process; 0 means no session."""
    return random.SystemRandom().randrange(1, 2**32)


def identity(purpose: str) -> str:
    """User, machine, process and purpose: `ada@lab-3 pid 4711, run 2026-11-21T09-...`."""
    try:
        user = getpass.getuser()
    except Exception:  # noqa: BLE001 - an account without a name; a stop must not fail by it
        user = "unknown"
    text = f"{user}@{platform.node() or 'unknown'} pid {os.getpid()}, {purpose}"
    return clipped(printable(text), LONGEST)
