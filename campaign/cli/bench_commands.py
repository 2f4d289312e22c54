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
        argument("[NAME]", "Show the options of this one.", autocompletion=complete_kind),
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
        str,
        option(
            "--bench",
            "BENCH",
            "Other parameters: from its first friction interface.",
        ),
    ] = "simulink",
    output: Annotated[Path | None, option("--output", "FILE.svg", "File of the picture.")] = None,
) -> Ended:
    """Draw friction models at a sinusoidal rate, with a CSV file beside the picture."""
    from campaign.cli.model import show_models

    motion = {"rate": rate, "frequency": frequency}
    return show_models(names, motion, changes or (), bench, output)


@command()
def schema(
    of: Annotated[
        str,
        typer.Argument(metavar="protocol|bench|mapping|report", help="Kind of file."),
    ],
) -> None:
    """Print a JSON Schema, with which editors complete and check TOML."""
    from campaign.cli.schemas import print_schema

    print_schema(of)


@command()
def new(
    kind: Annotated[
        str,
        typer.Argument(metavar="experiment|model|method|backend|format", help="Kind to provide."),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the package and its kind.")],
    output: Annotated[Path, option("--output", "DIR", "Parent of the new folder.")] = Path(),
) -> None:
    """Write a new package with a working kind and its test."""
    from campaign.cli.new_package import new_package

    new_package(kind, name, output)


@command()
def warmup() -> Ended:
    """Compile the engine now, once per installation, instead of in the first run."""
    from campaign.cli.compile_engine import warm_up

    return warm_up()


@command()
def doctor(results: given.Results = RESULTS, as_json: given.Json = False) -> Ended:
    """Show this installation, its problems, and what to do."""
    from campaign.cli.doctor import examine

    return examine(results, as_json=as_json)


@command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Created if missing.")],
    bench: Annotated[
        str,
        option(
            "--bench",
            "BENCH",
            "Write protocols for this bench instead: a TOML file, or a shipped bench's name.",
        ),
    ] = "",
    everything: Annotated[
        bool, flag("--all", "With --bench, also copy all shipped files.")
    ] = False,
) -> None:
    """Copy the shipped protocols, benches and templates into DIR, or write some for a bench."""
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
            "Bode plot, .svg or .png; default: BENCH-check.svg in this folder.",
        ),
    ] = None,
    as_json: given.Json = False,
) -> Ended:
    """Show the loops of a bench, their margins, and whether its values are consistent."""
    from campaign.cli.check import check_bench

    return check_bench(bench, output, as_json=as_json)


@command()
def fingerprint(
    bench: given.Bench,
    check: Annotated[
        bool, flag("--check", "Only compare the bench with its stated fingerprint.")
    ] = False,
) -> Ended:
    """Write a bench's fingerprint into its file: its known values apply to this state."""
    from campaign.cli.fingerprint import fingerprint_bench

    return fingerprint_bench(bench, check=check)


@command()
def device(
    bench: Annotated[
        str,
        option(
            "--bench",
            "BENCH",
            "Simulated bench: a TOML file, or a shipped bench's name.",
        ),
    ],
    pty: Annotated[bool, flag("--pty", "Serve a pseudo-terminal.")] = False,
    tcp: Annotated[
        str | None,
        option(
            "--tcp",
            "HOST:PORT",
            "Serve TCP there, port 0 for any; default without --pty: 127.0.0.1:0.",
        ),
    ] = None,
    speed: Annotated[str, option("--speed", "X", "Factor to the wall clock, or max.")] = "1",
    faults: Annotated[
        list[str] | None,
        several(
            "--fault",
            "NAME[=VALUE][@trial=N][@time=S]",
            "Fault to inject, e.g. drop=1e-4 or reboot@trial=2",
        ),
    ] = None,
    fault_seed: Annotated[int, option("--fault-seed", "N", "Seed of random faults.", min=0)] = 0,
    heartbeat_timeout: Annotated[
        float | None,
        option(
            "--heartbeat-timeout",
            "S",
            "Silence (s) after which it switches off; default: 0.1, at --speed max 3.",
            min=0.01,
            max=60.0,
        ),
    ] = None,
    latch: Annotated[
        str | None,
        option(
            "--latch",
            "FILE",
            "File that stores a panic stop; default: a temporary file; none: no file.",
        ),
    ] = None,
    new_latch: Annotated[
        bool, flag("--new-latch", "First start: create the --latch FILE, not latched.")
    ] = False,
    log: Annotated[
        Path | None, option("--log", "FILE", "Log drive, stops and hosts to this file.")
    ] = None,
) -> Ended:
    """Emulate a servo controller with a simulated bench, until Ctrl-C."""
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
    """Panic stop: switch the drive off and latch it, even if another program holds the port."""
    from campaign.cli.stop import stop_bench

    return stop_bench(port, baud, patience)


@command()
def status(
    port: given.Controller,
    baud: given.Baud = 2_000_000,
    patience: given.Patience = 3.0,
    as_json: given.Json = False,
) -> Ended:
    """Show the state of a controller, its holder, and any panic stop."""
    from campaign.cli.status import show_status

    return show_status(port, baud, patience, as_json=as_json)


@command("export-compensation")
def export_compensation_command(
    bench: given.Bench,
    name: Annotated[str, typer.Argument(metavar="NAME", help="A compensation in the bench file.")],
    target: Annotated[str, option("--to", "c|c-single|st|matlab|json", "Target language.")] = "c",
    output: Annotated[Path, option("--output", "DIR", "Output folder.")] = Path(),
) -> Ended:
    """Write a compensation of a bench as controller code, with test vectors."""
    from campaign.cli.export_compensation import export_compensation

    return export_compensation(bench, name, target, output), ExitCode.DONE
