"""`campaign`, and `python -m campaign`: listens to Ctrl-C before anything heavy is imported."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

INTERRUPTED = 130
AGAIN = 0.05
"""s after which a request that was lost is made again."""


def main() -> None:
    """Run the command line."""
    listen()
    try:
        from campaign.cli.main import main as run

        run()
    except KeyboardInterrupt:
        _leave()
    except SystemExit as leaving:
        if leaving.code == INTERRUPTED:
            # Python would end itself by SIGINT, had a KeyboardInterrupt passed through `exec`.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is left to do is to end


def listen() -> None:
    """Ctrl-C asks: KeyboardInterrupt, which unwinds what was begun; a second one leaves at once.

    Python drops an exception that a signal raises inside a callback of its own, such as a weak
    reference's. A KeyboardInterrupt that was dropped so is raised again, and no traceback is shown.
    While a run executes, `campaign.execution.stop` listens in its own way.
    """
    requests = _Requests()
    signal.signal(signal.SIGINT, requests.handle)
    sys.unraisablehook = requests.unraisable


def _leave() -> NoReturn:
    with suppress(OSError):  # nobody may be there to read it
        os.write(2, b"campaign: interrupted\n")
    os._exit(INTERRUPTED)


class _Requests:
    def __init__(self) -> None:
        self._asked = False
        self._lost = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        if self._asked and not self._lost:
            _leave()
        self._asked, self._lost = True, False
        raise KeyboardInterrupt

    def unraisable(self, unraisable: UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            sys.__unraisablehook__(unraisable)
            return
        self._lost = True
        again = threading.Timer(AGAIN, signal.raise_signal, (signal.SIGINT,))
        again.daemon = True
        again.start()


if __name__ == "__main__":
    main()
