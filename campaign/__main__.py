"""`campaign` and `python -m campaign`: handles Ctrl-C before any heavy import."""

from __future__ import annotations

import os
import sys

from campaign import interrupts
from campaign.gc_threshold import raise_gc_threshold


def main() -> None:
    """Run the command line."""
    interrupts.listen()
    raise_gc_threshold()
    # pydantic searches all installed packages for its plug-ins; a broken one would end the program.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        from campaign.cli.main import main as run

        run()
    except KeyboardInterrupt:
        interrupts.leave()
    except SystemExit as leaving:
        interrupts.deaf()
        import gc
        import threading

        # The process ends: do not search a million objects for cycles.
        gc.freeze()

        # Python would kill itself by SIGINT after a KeyboardInterrupt has passed through `exec`.
        # After an error it would wait for the thread of a blocked backend.
        interrupted = leaving.code == interrupts.INTERRUPTED
        if interrupted or (leaving.code and threading.active_count() > 1):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(leaving.code if isinstance(leaving.code, int) else 1)
        raise


if __name__ == "__main__":
    main()
