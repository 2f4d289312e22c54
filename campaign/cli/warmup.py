"""`campaign warmup`: compile the engine ahead."""

from __future__ import annotations

import time

from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode


def warm_up() -> ExitCode:
    """Make all machine code that the shipped benches need; say what, how long, and where it is."""
    from campaign.execution.first_start import Helpers, make_all
    from campaign.physics.compilation import distrusted
    from campaign.physics.machine_code import WIDTHS, CompiledPart, folder, is_made

    compiled: list[CompiledPart] = []
    kept = 0

    def tell(made: CompiledPart) -> None:
        nonlocal kept
        if made.compiled:
            compiled.append(made)
            print_line(f"{made.seconds:6.1f} s  {made.name}")
        else:
            kept += 1

    began = time.monotonic()
    if all(map(is_made, WIDTHS)):
        make_all(tell)
    else:
        print_note("compiling the engine (once per installation)")
        with Helpers() as helpers:
            make_all(tell, helpers)
    taken = time.monotonic() - began
    if compiled:
        print_line(f"compiled {len(compiled)} parts in {taken:.1f} s; {kept} were there")
    else:
        print_line(f"nothing to compile: all {kept} parts are there, loaded in {taken:.1f} s")
    where = folder()
    if where is None:
        print_note(
            distrusted()
            or "nothing is kept: the user's cache cannot be written; NUMBA_CACHE_DIR may name "
            "another folder",
            "yellow",
        )
    else:
        print_line(f"kept in {where}")
    return ExitCode.DONE
