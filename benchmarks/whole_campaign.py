"""Where a whole campaign's time goes: `campaign run --profile` of a shipped protocol.

    python -m benchmarks.whole_campaign [--protocol thesis] [--workers N] [--write]

The engine is compiled before. `--write` puts the table into docs/developers/performance.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile

from benchmarks.document import machine, write_section


def campaign(*arguments: str) -> str:
    """What a command says on standard error."""
    done = subprocess.run(
        [sys.executable, "-m", "campaign", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        env={**os.environ, "TERM": "dumb"},
        check=True,
    )
    return done.stderr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--protocol", default="thesis")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--write", action="store_true", help="into docs/developers/performance.md")
    arguments = parser.parse_args()
    campaign("warmup")
    options = ["--report", "--profile", "--workers", str(arguments.workers)]
    with tempfile.TemporaryDirectory() as folder:
        told = campaign("run", arguments.protocol, "--results", folder, *options)
    found = told[told.index("where the time went") :].strip()
    print(found)
    if arguments.write:
        command = f"campaign run {arguments.protocol} {' '.join(options)}"
        write_section("campaign", f"{machine()}: `{command}`\n\n```text\n{found}\n```")


if __name__ == "__main__":
    main()
