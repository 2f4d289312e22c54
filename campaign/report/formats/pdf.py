"""`NAME.pdf`: the unfolded page, printed by a browser on A4.

Chromium writes the time of printing into the file, so that the same page results in the same pages,
but not in the same bytes.
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
"""Time limit of printing."""

FLAGS = (
    "--headless",
    "--disable-gpu",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-extensions",
    "--disable-sync",
    "--disable-component-update",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # neither page nor browser needs the network
    "--no-pdf-header-footer",
)
PRINTED = """
@page { size: A4; @bottom-center { content: counter(page) " / " counter(pages); font-size: 8pt; } }
"""
"""Page numbers, in Chromium 131 and newer; older ones omit them."""

_FOLDED = re.compile(r"<details(?![^>]*\sopen\b)")


def browser() -> str | None:
    """Path of the first installed Chromium or Chrome; None without any."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def require() -> None:
    """Raise UsageError when no browser is installed."""
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
        last = _print(page, made, Path(scratch) / "profile")
        if not made.is_file():
            raise UsageError(f"--format pdf: {browser()} printed nothing: {last or 'no message'}")
        shutil.copyfile(made, written.folder / f"{written.name}.pdf")


def unfolded(html: str) -> str:
    """Page with all sections open and page numbers."""
    head, style, rest = html.partition("</style>")
    return f"{head}{PRINTED if style else ''}{style}{_FOLDED.sub('<details open', rest)}"


def _print(page: Path, made: Path, profile: Path) -> str:
    """Print; return the browser's last message. Raises UsageError on timeout or failed start."""
    command = [str(browser()), *FLAGS, f"--user-data-dir={profile}", f"--print-to-pdf={made}"]
    if _is_root():
        command.append("--no-sandbox")  # as root, Chromium does not start with a sandbox
    try:
        running = subprocess.Popen(  # noqa: S603 (no shell, no data of the run)
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
            _, messages = running.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            late = f"{command[0]} did not print the page within {SECONDS:g} s"
            raise UsageError(f"--format pdf: {late}") from None
        finally:  # also after Ctrl-C
            _end_all(running)
    return next(reversed(messages.strip().splitlines()), "")


def _is_root() -> bool:
    return os.name == "posix" and os.geteuid() == 0


def _end_all(running: subprocess.Popen[str]) -> None:
    """Kill the browser and all its child processes."""
    if os.name == "posix":
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(running.pid, signal.SIGKILL)
    else:
        running.kill()


FORMAT = Format("pdf", "report.pdf, printed on A4 by Chromium.", write, require)
