"""`campaign`, and `python -m campaign`: listens to Ctrl-C before anything heavy is imported."""

from __future__ import annotations

import os
import sys

from campaign import interrupts
from campaign.gc_threshold import raise_gc_threshold


def main() -> None:
    """Run the command line."""
    interrupts.listen()
    raise_gc_threshold()
    # pydantic looks into every installed package for plug-ins of its own, and a broken one ends it.
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

        # The system takes everything back at once: a million objects are not searched for cycles.
        gc.freeze()

        # Python would end itself by SIGINT, had a KeyboardInterrupt passed through `exec`; and
        # after an error it would wait for a stuck backend's thread.
        interrupted = leaving.code == interrupts.INTERRUPTED
        if interrupted or (leaving.code and threading.active_count() > 1):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(leaving.code if isinstance(leaving.code, int) else 1)
        raise


if __name__ == "__main__":
    main()
