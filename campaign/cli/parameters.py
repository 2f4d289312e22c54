"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from campaign.cli.completion import complete_protocol, complete_run

RESULTS = Path("results")
RUN = "A path, a run's name, or a unique beginning of it"


def option(name: str, metavar: str, told: str, **more: Any) -> Any:
    """An option with a value."""
    return typer.Option(name, metavar=metavar, help=told, **more)


def flag(name: str, told: str) -> Any:
    """An option without a value."""
    return typer.Option(name, help=told)


def several(name: str, metavar: str, told: str) -> Any:
    """An option that may be given again."""
    return typer.Option(name, metavar=metavar, help=f"{told}; may be given again.")


def argument(metavar: str, told: str, **more: Any) -> Any:
    """An argument; brackets in its metavar mark an optional one."""
    return typer.Argument(metavar=metavar, help=told, show_default=False, **more)


def workers_option(told: str) -> Any:
    """`--workers`: count of parallel items; by default one per processor."""
    told = f"{told}; default: one per processor."
    return option("--workers", "N", told, min=1, max=256)


Protocol = Annotated[
    str,
    typer.Argument(
        metavar="PROTOCOL",
        help="A TOML file, or the name of one in protocols/ or of a shipped protocol.",
        autocompletion=complete_protocol,
    ),
]
Run = Annotated[str, argument("RUN", f"{RUN}.", autocompletion=complete_run)]
NewestRun = Annotated[
    str | None,
    argument("[RUN]", f"{RUN}; default: the newest.", autocompletion=complete_run),
]
Bench = Annotated[
    str, typer.Argument(metavar="BENCH", help="A TOML file, or a shipped bench's name.")
]
Results = Annotated[Path, option("--results", "DIR", "Folder of the archives.")]
Only = Annotated[list[str] | None, several("--only", "TEST", "Only this test")]
Set = Annotated[
    list[str] | None,
    several("--set", "PATH=VALUE", "Change a value of the protocol, a bench or the backend"),
]
Backend = Annotated[str, option("--backend", "NAME", "Backend of the trials.")]
Large = Annotated[bool, flag("--allow-large", "Accept a plan of more than 100 000 trials.")]
Open = Annotated[bool, flag("--open", "Open the page in a browser.")]
Json = Annotated[bool, flag("--json", "Print JSON for machines.")]
Templates = Annotated[
    Path | None,
    option(
        "--templates",
        "DIR",
        "Templates that override the packaged ones; they are code, so trust them.",
    ),
]
Format = Annotated[
    list[str] | None, several("--format", "NAME", "Besides the page: markdown, latex, pdf")
]
Workers = Annotated[int | None, workers_option("Parallel trials, if the backend permits")]
Watch = Annotated[bool, flag("--watch", "Draw channels of the running trial in the terminal.")]
Executor = Annotated[
    str,
    option(
        "--executor",
        "WHERE",
        "Execute simulated trials on a Dask cluster: dask (on this machine), or "
        "dask://HOST:PORT of a scheduler.",
    ),
]
Tls = Annotated[
    Path | None,
    option(
        "--executor-tls",
        "DIR",
        "Folder with ca.pem, cert.pem and key.pem for a scheduler on another machine.",
    ),
]
Report = Annotated[bool, flag("--report", "Also build the report.")]
Yes = Annotated[bool, flag("--yes", "For scripts: no prompt, not even before a bench moves.")]
ClearStop = Annotated[
    int | None,
    option(
        "--clear-stop",
        "COUNT",
        "Clear the panic stop of this count, seen by a person.",
        min=0,
    ),
]
Port = Annotated[
    str | None,
    option("--port", "PORT", "Port of the controller; short for --set backend.port=PORT."),
]
Controller = Annotated[str, option("--port", "PORT", "Port of the controller.")]
Baud = Annotated[int, option("--baud", "RATE", "Rate of a serial port.", min=1200)]
Patience = Annotated[float, option("--patience", "S", "Time limit (s).", min=0.1, max=600.0)]
From = Annotated[
    str | None, option("--from", "RUN", "The run to replay; short for --set backend.run=RUN.")
]
Handover = Annotated[
    Path | None,
    option(
        "--handover",
        "DIR",
        "Folder of handed-out trials, with --backend files; short for --set backend.folder=DIR.",
    ),
]
Truth = Annotated[
    str,
    option(
        "--truth",
        "BENCH",
        "Bench that sim simulates in place of each test's; plan and analysis do not use it.",
    ),
]
Sign = Annotated[
    Path | None,
    option(
        "--sign",
        "FILE",
        "Sign the sealed run with this OpenSSH key, or with its agent; tested before any motion.",
    ),
]
