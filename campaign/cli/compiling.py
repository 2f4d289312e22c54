"""Compiling the engine while a command prepares, and saying so when there is nothing else to do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from campaign.backends import backends
from campaign.cli.output import error_console, print_note
from campaign.interrupts import unwinding

if TYPE_CHECKING:
    from campaign.execution.first_start import FirstStart

COMPILING = "compiling the engine (once per installation)"


@contextmanager
def compiling_meanwhile(backend: str) -> Iterator[FirstStart | None]:
    """Inside the block the engine is compiled, if that backend runs it and it never was.

    Hand what is yielded to `wait_until_compiled` before the first trial.
    """
    kind = backends().get(backend)
    if kind is None or not kind.simulates:
        yield None
        return
    from campaign.execution.first_start import FirstStart
    from campaign.physics.compiled import distrusted

    if why := distrusted():
        print_note(why, "yellow")
    with FirstStart() as first:
        yield first


def wait_until_compiled(first: FirstStart | None) -> None:
    """Wait, and say what for."""
    if first is None or not first.is_busy:
        return
    console = error_console()
    if not console.is_terminal:
        print_note(COMPILING)
        first.wait()
        return
    with unwinding(), console.status(COMPILING):  # which hides the cursor, and shows it again
        first.wait()
