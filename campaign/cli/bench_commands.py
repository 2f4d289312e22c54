"""Commands on benches, kinds and files, and commands for the installation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from campaign.cli import parameters as given
from campaign.cli.app import Ended, command
from campaign.cli.archive_commands import app
from campaign.cli.completion import complete_kind
from campaign.cli.parameters import RESULTS, argument, flag, option, several
from campaign.errors import ExitCode

__all__ = ["app"]


@command()
def kinds(
    name: Annotated[
        str | None,
        argument("[NAME]", "One of them, with its options.", autocompletion=complete_kind),
    ] = None,
) -> None:
    """List experiments, friction models, compensation methods and backends."""
    from campaign.cli.kinds import list_kinds, show_kind

    if name is None:
        list_kinds()
    else:
        show_kind(name)


@command()
def model(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="Friction models or specimens of `campaign kinds`."),
    ],
    rate: Annotated[str, option("--rate", "RATE", "Amplitude of the rate.")] = "1 deg/s",
    frequency: Annotated[str, option("--frequency", "FREQUENCY", "Of the rate.")] = "1 Hz",
    changes: Annotated[list[str] | None, several("--set", "PARAMETER=VALUE", "A parameter")] = None,
    bench: Annotated[
        str, option("--bench", "BENCH", "Its first friction interface gives the others.")
    ] = "simulink",
    output: Annotated[Path | None, option("--output", "FILE.svg", "Where to draw.")] = None,
) -> Ended:
    """Draw friction models alone, at a sinusoidal rate; CSV beside the picture."""
    from campaign.cli.model import show_models

    motion = {"rate": rate, "frequency": frequency}
    return show_models(names, motion, changes or (), bench, output)


@command()
def schema(
    of: Annotated[
        str,
        typer.Argument(metavar="protocol|bench|mapping|report", help="Which files it describes."),
    ],
) -> None:
    """Print a JSON Schema, by which editors complete and check TOML."""
    from campaign.cli.schemas import print_schema

    print_schema(of)


@command()
def new(
    kind: Annotated[
        str,
        typer.Argument(metavar="experiment|model|method|backend|format", help="What it provides."),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the package and its kind.")],
    output: Annotated[Path, option("--output", "DIR", "Where its folder is made.")] = Path(),
) -> None:
    """Write a package of your own: a kind that works, with a test."""
    from campaign.cli.new_package import new_package

    new_package(kind, name, output)


@command()
def warmup() -> Ended:
    """Compile the engine now, once per installation, instead of in the first run."""
    from campaign.cli.compile_engine import warm_up

    return warm_up()


@command()
def doctor(results: given.Results = RESULTS, as_json: given.Json = False) -> Ended:
    """Say what this installation is, what is wrong with it, and what to do."""
    from campaign.cli.doctor import examine

    return examine(results, as_json=as_json)


@command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Made when it is not there.")],
    bench: Annotated[
        str,
        option(
            "--bench",
            "BENCH",
            "Write protocols for this bench instead: a TOML file, or a shipped bench's name.",
        ),
    ] = "",
    everything: Annotated[
        bool, flag("--all", "Beside those of a bench, copy all that is shipped, too.")
    ] = False,
) -> None:
    """Copy the shipped protocols, benches and templates into DIR, or write a bench its own."""
    if bench:
        from campaign.cli.rig_protocols import init_for_bench

        init_for_bench(folder, bench)
    if everything or not bench:
        from campaign.cli.schemas import init_folder

        init_folder(folder)


@command()
def check(
    bench: given.Bench,
    output: Annotated[
        Path | None,
        option(
            "--output",
            "FILE",
            "The Bode picture, .svg or .png; BENCH-check.svg in this folder when absent.",
        ),
    ] = None,
    as_json: given.Json = False,
) -> Ended:
    """Show the loops of a bench, their margins, and whether its sizes fit each other."""
    from campaign.cli.check import check_bench

    return check_bench(bench, output, as_json=as_json)


@command()
def fingerprint(
    bench: given.Bench,
    check: Annotated[
        bool, flag("--check", "Only say whether the bench is the one described.")
    ] = False,
) -> Ended:
    """State in a bench's file that what is known of it is said of the bench as it is now."""
    from campaign.cli.fingerprint import fingerprint_bench

    return fingerprint_bench(bench, check=check)


@command()
def device(
    bench: Annotated[
        str,
        option(
            "--bench",
            "BENCH",
            "The bench behind the controller: a TOML file, or a shipped bench's name.",
        ),
    ],
    pty: Annotated[bool, flag("--pty", "Serve a pseudo-terminal.")] = False,
    tcp: Annotated[
        str | None,
        option(
            "--tcp",
            "HOST:PORT",
            "Serve TCP there, port 0 for any; without --pty and --tcp 127.0.0.1:0.",
        ),
    ] = None,
    speed: Annotated[str, option("--speed", "X", "Times the wall clock, or max.")] = "1",
    faults: Annotated[
        list[str] | None,
        several(
            "--fault",
            "NAME[=VALUE][@trial=N][@time=S]",
            "What shall go wrong, e.g. drop=1e-4 or reboot@trial=2",
        ),
    ] = None,
    fault_seed: Annotated[int, option("--fault-seed", "N", "Of what fails by chance.", min=0)] = 0,
    heartbeat_timeout: Annotated[
        float | None,
        option(
            "--heartbeat-timeout",
            "S",
            "Silence after which it switches off; 0.1 s, at --speed max 3 s if absent.",
            min=0.01,
            max=60.0,
        ),
    ] = None,
    latch: Annotated[
        str | None,
        option(
            "--latch",
            "FILE",
            "Where it remembers that it was stopped; a new file if absent; none: nowhere.",
        ),
    ] = None,
    new_latch: Annotated[
        bool, flag("--new-latch", "First start: make the --latch FILE, not latched.")
    ] = False,
    log: Annotated[
        Path | None, option("--log", "FILE", "Note drive, stops and hosts there.")
    ] = None,
) -> Ended:
    """Emulate a servo controller with a simulated bench; Ctrl-C ends it."""
    from campaign.cli.device import run_device

    return run_device(
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


@command()
def stop(
    port: given.Controller, baud: given.Baud = 2_000_000, patience: given.Patience = 10.0
) -> Ended:
    """Panic stop: drive off, and off it stays; works whoever has the port, and while that hangs."""
    from campaign.cli.stop import stop_bench

    return stop_bench(port, baud, patience)


@command()
def status(
    port: given.Controller,
    baud: given.Baud = 2_000_000,
    patience: given.Patience = 3.0,
    as_json: given.Json = False,
) -> Ended:
    """Show how a controller is, who holds it, and whether somebody has stopped it."""
    from campaign.cli.status import show_status

    return show_status(port, baud, patience, as_json=as_json)


@command("export-compensation")
def export_compensation_command(
    bench: given.Bench,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the bench's [compensation].")],
    target: Annotated[str, option("--to", "c|c-single|st|matlab|json", "In which form.")] = "c",
    output: Annotated[Path, option("--output", "DIR", "Where to write it.")] = Path(),
) -> Ended:
    """Write a compensation of a bench as code for a controller, with test vectors."""
    from campaign.cli.export_compensation import export_compensation

    return export_compensation(bench, name, target, output), ExitCode.DONE
