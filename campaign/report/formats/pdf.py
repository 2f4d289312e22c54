"""`NAME.pdf`: the page printed by a browser on A4, unfolded.

Chromium writes the time of printing into the file, so the same page gives the same pages and not
the same bytes.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path

from campaign.errors import UsageError
from campaign.report.formats.interface import Format, WrittenPage

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SECONDS = 180.0
"""The longest that printing may take."""

FLAGS = (
    "--headless",
    "--disable-gpu",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-extensions",
    "--disable-sync",
    "--disable-component-update",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # the page asks for nothing, nor does the browser
    "--no-pdf-header-footer",
)
PRINTED = """
@page { size: A4; @bottom-center { content: counter(page) " / " counter(pages); font-size: 8pt; } }
"""
"""Page numbers, by Chromium 131 and newer; an older one leaves them out."""

_FOLDED = re.compile(r"<details(?![^>]*\sopen\b)")


def browser() -> str | None:
    """The Chromium or Chrome that is found first; None without any."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def require() -> None:
    """Raise UsageError where no browser is installed."""
    if browser() is None:
        raise UsageError(
            f"--format pdf needs Chromium or Chrome; none of {', '.join(BROWSERS)} is on the PATH."
            " On Debian: apt install chromium"
        )


def write(written: WrittenPage) -> None:
    """Add `NAME.pdf`. Raises UsageError when the browser cannot print it."""
    require()
    with tempfile.TemporaryDirectory(prefix="campaign-pdf-") as scratch:
        page, made = Path(scratch) / "page.html", Path(scratch) / "page.pdf"
        html = (written.folder / f"{written.name}.html").read_text(encoding="utf-8")
        page.write_text(unfolded(html), encoding="utf-8")
        told = _print(page, made, Path(scratch) / "profile")
        if not made.is_file():
            raise UsageError(f"--format pdf: {browser()} printed nothing: {told or 'no message'}")
        shutil.copyfile(made, written.folder / f"{written.name}.pdf")


def unfolded(html: str) -> str:
    """The page with everything open and numbers at the foot of each sheet."""
    head, style, rest = html.partition("</style>")
    return f"{head}{PRINTED if style else ''}{style}{_FOLDED.sub('<details open', rest)}"


def _print(page: Path, made: Path, profile: Path) -> str:
    """What the browser said last. Raises UsageError when it takes too long or cannot start."""
    command = [str(browser()), *FLAGS, f"--user-data-dir={profile}", f"--print-to-pdf={made}"]
    if _is_root():
        command.append("--no-sandbox")  # as root, Chromium runs with none or not at all
    try:
        running = subprocess.Popen(  # noqa: S603 (no shell, and nothing of the run is in it)
            [*command, page.as_uri()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as error:
        raise UsageError(f"--format pdf: {command[0]}: {error.strerror}") from None
    with running:
        try:
            _, told = running.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            late = f"{command[0]} did not print the page within {SECONDS:g} s"
            raise UsageError(f"--format pdf: {late}") from None
        finally:  # also when somebody pressed Ctrl-C
            _end_all(running)
    return next(reversed(told.strip().splitlines()), "")


def _is_root() -> bool:
    return os.name == "posix" and os.geteuid() == 0


def _end_all(running: subprocess.Popen[str]) -> None:
    """End the browser and all that it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(running.pid, signal.SIGKILL)
    else:
        running.kill()


FORMAT = Format("pdf", "report.pdf, printed on A4 by Chromium.", write, require)
