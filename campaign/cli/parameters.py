"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from campaign.cli.completion import complete_protocol, complete_run


def output_option(metavar: str, help_text: str) -> Any:
    """`--output`: what is written differs from command to command, how it is named does not."""
    return typer.Option("--output", metavar=metavar, help=help_text, show_default=False)


def workers_option(help_text: str) -> Any:
    """`--workers`: how many of something at once, one per processor when absent."""
    told = f"{help_text}; one per processor if absent."
    return typer.Option("--workers", metavar="N", min=1, max=256, help=told, show_default=False)


ProtocolArgument = Annotated[
    str,
    typer.Argument(
        metavar="PROTOCOL",
        help="A TOML file, or the name of a shipped protocol.",
        autocompletion=complete_protocol,
    ),
]
RunArgument = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="A path, a run's name, or a unique beginning of it.",
        show_default=False,
        autocompletion=complete_run,
    ),
]
NewestRunArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="[RUN]",
        help="A path, a run's name, or a unique beginning of it; the newest when absent.",
        show_default=False,
        autocompletion=complete_run,
    ),
]
BenchArgument = Annotated[
    str, typer.Argument(metavar="BENCH", help="A TOML file, or a shipped bench's name.")
]
ResultsOption = Annotated[
    Path, typer.Option("--results", metavar="DIR", help="Where the archives are.")
]
OnlyOption = Annotated[
    list[str] | None,
    typer.Option("--only", metavar="TEST", help="Only this test; may be given again."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Change a value of the protocol, a bench or the backend; may be given again.",
    ),
]
BackendOption = Annotated[
    str, typer.Option("--backend", metavar="NAME", help="What executes the trials.")
]
LargeOption = Annotated[
    bool, typer.Option("--allow-large", help="Accept a plan of more than 100 000 trials.")
]
OpenOption = Annotated[bool, typer.Option("--open", help="Open it in a browser.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
TemplatesOption = Annotated[
    Path | None,
    typer.Option(
        "--templates",
        metavar="DIR",
        help="Templates that win over the packaged ones; they are code, so trust them.",
        show_default=False,
    ),
]
FormatOption = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="NAME",
        help="Besides the page: markdown, latex, pdf; may be given again.",
    ),
]
WorkersOption = Annotated[
    int | None, workers_option("Trials executed at once, where the backend can")
]
WatchOption = Annotated[
    bool, typer.Option("--watch", help="Draw channels of the running trial in the terminal.")
]
ExecutorOption = Annotated[
    str,
    typer.Option(
        "--executor",
        metavar="WHERE",
        help="Execute simulated trials on a Dask cluster: dask (of this machine), or "
        "dask://HOST:PORT of a scheduler.",
        show_default=False,
    ),
]
TlsOption = Annotated[
    Path | None,
    typer.Option(
        "--executor-tls",
        metavar="DIR",
        help="Folder with ca.pem, cert.pem and key.pem for a scheduler on another machine.",
        show_default=False,
    ),
]
ReportOption = Annotated[bool, typer.Option("--report", help="Build the report as well.")]
YesOption = Annotated[
    bool, typer.Option("--yes", help="For scripts: do not prompt, also not before a bench moves.")
]
ClearStopOption = Annotated[
    int | None,
    typer.Option(
        "--clear-stop",
        metavar="COUNT",
        min=0,
        help="Clear a panic stop, by the count that a person has seen.",
        show_default=False,
    ),
]
PortOption = Annotated[
    str | None,
    typer.Option(
        "--port",
        metavar="PORT",
        help="Where the controller is; short for --set backend.port=PORT.",
        show_default=False,
    ),
]
ControllerOption = Annotated[
    str, typer.Option("--port", metavar="PORT", help="Where the controller is.")
]
BaudOption = Annotated[
    int, typer.Option("--baud", metavar="RATE", min=1200, help="Of a serial port.")
]
PatienceOption = Annotated[
    float,
    typer.Option("--patience", metavar="S", min=0.1, max=600.0, help="Until it gives up."),
]
FromOption = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="RUN",
        help="The run to replay; short for --set backend.run=RUN.",
        show_default=False,
    ),
]
HandoverOption = Annotated[
    Path | None,
    typer.Option(
        "--handover",
        metavar="DIR",
        help="Where trials are handed out, with --backend files; short for "
        "--set backend.folder=DIR.",
        show_default=False,
    ),
]
TruthOption = Annotated[
    str,
    typer.Option(
        "--truth",
        metavar="BENCH",
        help="What sim simulates in place of each test's bench; plan and analysis do not know it.",
        show_default=False,
    ),
]
SignOption = Annotated[
    Path | None,
    typer.Option(
        "--sign",
        metavar="FILE",
        help="Sign the sealed run with this key of OpenSSH, or with its agent; tried before "
        "anything moves.",
        show_default=False,
    ),
]
RESULTS = Path("results")
