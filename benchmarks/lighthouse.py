"""Lighthouse's scores of a report's page, served compressed: `make lighthouse REPORT=FOLDER`.

A page is served by this machine to this machine; Lighthouse's presets slow the network and the
processor down to a desk's and to a telephone's. Ends with 1 when a goal is missed.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIGHTHOUSE = ROOT / "tests" / "browser" / "node_modules" / "lighthouse" / "cli" / "index.js"
NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PRESETS = {"desktop": ("--preset=desktop",), "mobile": ()}
LARGEST = 4_000_000
"""Bytes of the page as it lies on the disk."""


@dataclass(frozen=True)
class Scores:
    """What a preset gives; times in seconds."""

    accessibility: float
    performance: float
    first_paint: float
    largest_paint: float
    blocked: float
    shift: float
    nodes: int
    failed: tuple[str, ...]

    def missed(self, preset: str) -> list[str]:
        """The goals that it misses."""
        goals = {
            "accessibility 1.0": self.accessibility == 1.0,
            "performance 0.95": preset != "desktop" or self.performance >= 0.95,
            "first paint within 2.5 s": preset != "mobile" or self.first_paint < 2.5,
        }
        return [goal for goal, reached in goals.items() if not reached]


@contextmanager
def served(page: Path) -> Iterator[str]:
    """The address of a server of this one page, compressed, on this machine alone."""
    body = gzip.compress(page.read_bytes(), 9)

    class OnePage(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            found = self.path == "/report.html"
            self.send_response(200 if found else 404)
            if found:
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Encoding", "gzip")
            self.send_header("Content-Length", str(len(body) if found else 0))
            self.end_headers()
            if found:
                self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), OnePage)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/report.html"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def measured(address: str, preset: str, chromium: str, node: str) -> Scores:
    """Run Lighthouse once."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "found.json"
        subprocess.run(
            [
                *(node, LIGHTHOUSE, address, *PRESETS[preset], "--quiet"),
                *("--output=json", f"--output-path={output}"),
                "--only-categories=performance,accessibility",
                f"--chrome-flags={' '.join((*FLAGS, f'--user-data-dir={folder}/profile'))}",
                "--no-enable-error-reporting",
            ],
            check=True,
            env=os.environ | {"CHROME_PATH": chromium},
        )
        found = json.loads(output.read_text(encoding="utf-8"))
    if "runtimeError" in found:
        raise SystemExit(f"Lighthouse: {found['runtimeError']['message']}")
    audits = found["audits"]
    number = {
        name: audits[name]["numericValue"] for name in audits if "numericValue" in audits[name]
    }
    return Scores(
        found["categories"]["accessibility"]["score"],
        found["categories"]["performance"]["score"],
        number["first-contentful-paint"] / 1e3,
        number["largest-contentful-paint"] / 1e3,
        number["total-blocking-time"] / 1e3,
        number["cumulative-layout-shift"],
        int(number["dom-size"]),
        tuple(
            f"{name} ({len(audit.get('details', {}).get('items', ()))} times)"
            for each in found["categories"]["accessibility"]["auditRefs"]
            if (audit := audits[name := each["id"]])["score"] == 0 and each["weight"]
        ),
    )


def main(folder: Path) -> int:
    page = folder / "report.html" if folder.is_dir() else folder
    chromium = next(filter(None, map(shutil.which, NAMES)), None)
    node = shutil.which("node")
    if not page.is_file() or chromium is None or node is None or not LIGHTHOUSE.is_file():
        print(f"needs {page}, Chromium, Node.js and {LIGHTHOUSE} (make lighthouse)")
        return 2
    size, sent = page.stat().st_size, len(gzip.compress(page.read_bytes(), 9))
    print(f"page {size / 1e6:.2f} MB, {sent / 1e6:.2f} MB compressed")
    missed = [] if size < LARGEST else ["page: below 4 MB"]
    with served(page) as address:
        for preset in PRESETS:
            scores = measured(address, preset, chromium, node)
            print(
                f"{preset:8} accessibility {scores.accessibility:.2f}"
                f"  performance {scores.performance:.2f}"
                f"  first paint {scores.first_paint:.2f} s  largest {scores.largest_paint:.2f} s"
                f"  blocked {scores.blocked:.2f} s  shift {scores.shift:.3f}"
                f"  elements {scores.nodes}"
            )
            for rule in scores.failed:
                print(f"         {rule}")
            missed += [f"{preset}: {goal}" for goal in scores.missed(preset)]
    for goal in missed:
        print(f"missed  {goal}")
    return 1 if missed else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: make lighthouse REPORT=FOLDER")
    raise SystemExit(main(Path(sys.argv[1])))
