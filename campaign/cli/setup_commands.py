"""Setup commands: kinds, model, schema, new, warmup, doctor, init."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from campaign.cli.completion import complete_kind
from campaign.cli.output import print_line
from campaign.cli.parameters import RESULTS, JsonOption, ResultsOption
from campaign.cli.rig_commands import app

__all__ = ["app"]


@app.command()
def kinds(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]",
            help="One of them, with its options.",
            show_default=False,
            autocompletion=complete_kind,
        ),
    ] = None,
) -> None:
    """List experiments, friction models, compensation methods and backends."""
    from campaign.cli.kinds import list_kinds, show_kind

    if name is None:
        list_kinds()
    else:
        show_kind(name)


@app.command()
def model(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="Friction models or specimens of `campaign kinds`."),
    ],
    rate: Annotated[
        str, typer.Option("--rate", metavar="RATE", help="Amplitude of the rate.")
    ] = "1 deg/s",
    frequency: Annotated[
        str, typer.Option("--frequency", metavar="FREQUENCY", help="Of the rate.")
    ] = "1 Hz",
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PARAMETER=VALUE", help="A parameter; may be given again."),
    ] = None,
    bench: Annotated[
        str,
        typer.Option(
            "--bench", metavar="BENCH", help="Its first friction interface gives the others."
        ),
    ] = "simulink",
    output: Annotated[
        Path | None,
        typer.Option("--output", metavar="FILE.svg", help="Where to draw.", show_default=False),
    ] = None,
) -> None:
    """Draw friction models alone, at a sinusoidal rate; CSV beside the picture."""
    from campaign.cli.model import show_models

    motion = {"rate": rate, "frequency": frequency}
    print_line(str(show_models(names, motion, changes or (), bench, output)))


@app.command()
def schema(
    of: Annotated[
        str,
        typer.Argument(metavar="protocol|bench|mapping|report", help="Which files it describes."),
    ],
) -> None:
    """Print a JSON Schema, by which editors complete and check TOML."""
    from campaign.cli.schemas import print_schema

    print_schema(of)


@app.command()
def new(
    kind: Annotated[
        str,
        typer.Argument(metavar="experiment|model|method|backend|format", help="What it provides."),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the package and its kind.")],
    output: Annotated[
        Path, typer.Option("--output", metavar="DIR", help="Where its folder is made.")
    ] = Path(),
) -> None:
    """Write a package of your own: a kind that works, with a test."""
    from campaign.cli.new_package import new_package

    new_package(kind, name, output)


@app.command()
def warmup() -> None:
    """Compile the engine now, once per installation, instead of in the first run."""
    from campaign.cli.warmup import warm_up

    raise typer.Exit(warm_up())


@app.command()
def doctor(results: ResultsOption = RESULTS, as_json: JsonOption = False) -> None:
    """Say what this installation is, what is wrong with it, and what to do."""
    from campaign.cli.doctor import examine

    raise typer.Exit(examine(results, as_json=as_json))


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Made when it is not there.")],
    bench: Annotated[
        str,
        typer.Option(
            "--bench",
            metavar="BENCH",
            help="Write protocols for this bench instead: a TOML file, or a shipped bench's name.",
            show_default=False,
        ),
    ] = "",
    everything: Annotated[
        bool,
        typer.Option("--all", help="Beside those of a bench, copy all that is shipped, too."),
    ] = False,
) -> None:
    """Copy the shipped protocols, benches and templates into DIR, or write a bench its own."""
    if bench:
        from campaign.cli.rig_protocols import init_for_bench

        init_for_bench(folder, bench)
    if bench and not everything:
        return
    from campaign.cli.schemas import init_folder

    init_folder(folder)
