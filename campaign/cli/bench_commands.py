"""Commands at a bench: status, emulated controller, stop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from campaign.cli.output import print_line
from campaign.cli.parameters import (
    BaudOption,
    BenchArgument,
    ControllerOption,
    JsonOption,
    PatienceOption,
    output_option,
)
from campaign.cli.setup_commands import app

__all__ = ["app"]


@app.command()
def check(
    bench: BenchArgument,
    output: Annotated[
        Path | None,
        output_option(
            "FILE", "The Bode picture, .svg or .png; BENCH-check.svg in this folder when absent."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the loops of a bench, their margins, and whether its sizes fit each other."""
    from campaign.cli.check import check_bench

    raise typer.Exit(check_bench(bench, output, as_json=as_json))


@app.command()
def fingerprint(
    bench: BenchArgument,
    check: Annotated[
        bool, typer.Option("--check", help="Only say whether the bench is the one described.")
    ] = False,
) -> None:
    """State in a bench's file that what is known of it is said of the bench as it is now."""
    from campaign.cli.fingerprint import fingerprint_bench

    raise typer.Exit(fingerprint_bench(bench, check=check))


@app.command()
def device(
    bench: Annotated[
        str,
        typer.Option(
            "--bench",
            metavar="BENCH",
            help="The bench behind the controller: a TOML file, or a shipped bench's name.",
        ),
    ],
    pty: Annotated[bool, typer.Option("--pty", help="Serve a pseudo-terminal.")] = False,
    tcp: Annotated[
        str | None,
        typer.Option(
            "--tcp",
            metavar="HOST:PORT",
            help="Serve TCP there, port 0 for any; without --pty and --tcp 127.0.0.1:0.",
            show_default=False,
        ),
    ] = None,
    speed: Annotated[
        str,
        typer.Option("--speed", metavar="X", help="Times the wall clock, or max."),
    ] = "1",
    faults: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="NAME[=VALUE][@trial=N][@time=S]",
            help="What shall go wrong, e.g. drop=1e-4 or reboot@trial=2; may be given again.",
        ),
    ] = None,
    fault_seed: Annotated[
        int, typer.Option("--fault-seed", metavar="N", min=0, help="Of what fails by chance.")
    ] = 0,
    heartbeat_timeout: Annotated[
        float | None,
        typer.Option(
            "--heartbeat-timeout",
            metavar="S",
            min=0.01,
            max=60.0,
            help="Silence after which it switches off; 0.1 s, at --speed max 3 s if absent.",
            show_default=False,
        ),
    ] = None,
    latch: Annotated[
        str | None,
        typer.Option(
            "--latch",
            metavar="FILE",
            help="Where it remembers that it was stopped; a new file if absent; none: nowhere.",
            show_default=False,
        ),
    ] = None,
    new_latch: Annotated[
        bool,
        typer.Option("--new-latch", help="First start: make the --latch FILE, not latched."),
    ] = False,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log", metavar="FILE", help="Note drive, stops and hosts there.", show_default=False
        ),
    ] = None,
) -> None:
    """Be a servo controller with a simulated bench, to rehearse against; Ctrl-C ends it."""
    from campaign.cli.device import run_device

    raise typer.Exit(
        run_device(
            bench,
            tcp=tcp,
            pty=pty,
            speed=speed,
            heartbeat_timeout=heartbeat_timeout,
            faults=faults or (),
            fault_seed=fault_seed,
            latch=latch,
            new_latch=new_latch,
            log=log,
        )
    )


@app.command()
def stop(
    port: ControllerOption,
    baud: BaudOption = 2_000_000,
    patience: PatienceOption = 10.0,
) -> None:
    """Panic stop: drive off, and off it stays; works whoever has the port, and while that hangs."""
    from campaign.cli.stop import stop_bench

    raise typer.Exit(stop_bench(port, baud, patience))


@app.command()
def status(
    port: ControllerOption,
    baud: BaudOption = 2_000_000,
    patience: PatienceOption = 3.0,
    as_json: JsonOption = False,
) -> None:
    """Show how a controller is, who holds it, and whether somebody has stopped it."""
    from campaign.cli.status import show_status

    raise typer.Exit(show_status(port, baud, patience, as_json=as_json))


@app.command("export-compensation")
def export_compensation_command(
    bench: BenchArgument,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the bench's [compensation].")],
    target: Annotated[
        str, typer.Option("--to", metavar="c|c-single|st|matlab|json", help="In which form.")
    ] = "c",
    output: Annotated[
        Path, typer.Option("--output", metavar="DIR", help="Where to write it.")
    ] = Path(),
) -> None:
    """Write a compensation of a bench as code for a controller, with test vectors."""
    from campaign.cli.export_compensation import export_compensation

    for path in export_compensation(bench, name, target, output):
        print_line(str(path))
