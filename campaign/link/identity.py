"""Who a host is, in the words that a controller keeps and tells to whoever asks."""

from __future__ import annotations

import getpass
import os
import platform
import random

LONGEST = 120
"""Bytes of UTF-8; a controller may have little memory."""


def new_session() -> int:
    """A random number for one process' time with a controller; 0 would be nobody's."""
    return random.SystemRandom().randrange(1, 2**32)


def identity(purpose: str) -> str:
    """User, machine, process and what it is about: `ada@lab-3 pid 4711, run 2026-11-21T09-...`."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # an account without a name
        user = "unknown"
    text = f"{user}@{platform.node() or 'unknown'} pid {os.getpid()}, {purpose}"
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    return printable.encode("utf-8", "replace")[:LONGEST].decode("utf-8", "ignore")
