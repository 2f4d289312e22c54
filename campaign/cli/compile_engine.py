"""Compilation of the engine: while a command prepares, or ahead (`campaign warmup`)."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from campaign.backends import backends
from campaign.backends.interface import Backend
from campaign.backends.sim import SimBackend
from campaign.cli.output import error_console, print_line, print_note, print_warning
from campaign.errors import ExitCode
from campaign.interrupts import unwinding
from campaign.trial import Trial

if TYPE_CHECKING:
    from campaign.execution.first_start import FirstStart

COMPILING = "compiling the engine (once per installation)"
WORTH_A_BLOCK = 2e7
"""Least steps of jointly simulated trials for compiling blocks: five runs save its cost."""


@contextmanager
def compiling_meanwhile(backend: str) -> Iterator[FirstStart | None]:
    """Inside the block, compile the engine if the backend needs it and it is not compiled yet.

    Pass the yielded object to `wait_until_compiled` before the first trial.
    """
    kind = backends().get(backend)
    if kind is None or not kind.simulates:
        yield None
        return
    from campaign.execution.first_start import FirstStart
    from campaign.physics.compilation import distrusted

    if why := distrusted():
        print_warning(why)
    with FirstStart() as first:
        yield first


def wait_until_compiled(
    first: FirstStart | None, backend: Backend, trials: Sequence[Trial]
) -> None:
    """Compile the parts that these trials need, and print the reason for the wait.

    Without a compiled engine for blocks, few trials are executed one by one.
    """
    if first is None or not isinstance(backend, SimBackend):
        return
    from campaign.physics.machine_code import is_made
    from campaign.physics.vector import LANES

    if not is_made(LANES):
        if backend.steps_together(trials) > WORTH_A_BLOCK:
            first.need(LANES)
        else:
            backend.has_blocks = False
    if not first.is_busy:
        return
    make_ready = partial(backend.make_ready, trials)
    console = error_console()
    if not console.is_terminal:
        print_note(COMPILING)
        first.wait(make_ready)
        return
    with unwinding(), console.status(COMPILING):  # its end restores the hidden cursor
        first.wait(make_ready)


def warm_up() -> ExitCode:
    """Compile all machine code of the shipped benches; print the parts, their time and folder."""
    from campaign.execution.first_start import Helpers, make_all
    from campaign.physics.compilation import distrusted
    from campaign.physics.machine_code import WIDTHS, CompiledPart, folder, is_made

    parts: list[CompiledPart] = []

    def tell(made: CompiledPart) -> None:
        parts.append(made)
        if made.compiled:
            print_line(f"{made.seconds:6.1f} s  {made.name}")

    began = time.monotonic()
    if all(map(is_made, WIDTHS)):
        make_all(tell)
    else:
        print_note(COMPILING)
        with Helpers() as helpers:
            make_all(tell, helpers)
    taken = time.monotonic() - began
    if compiled := sum(part.compiled for part in parts):
        print_line(f"compiled {compiled} parts in {taken:.1f} s; {len(parts) - compiled} existed")
    else:
        print_line(f"nothing to compile: all {len(parts)} parts exist, loaded in {taken:.1f} s")
    where = folder()
    if where is None:
        print_warning(
            distrusted()
            or "nothing is kept: the user's cache cannot be written; set NUMBA_CACHE_DIR to "
            "another folder"
        )
    else:
        print_line(f"kept in {where}")
    return ExitCode.DONE
