"""Commands about a rig over its runs: identify, trend."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from campaign.cli.archive_commands import app
from campaign.cli.output import print_line
from campaign.cli.parameters import (
    RESULTS,
    FormatOption,
    OpenOption,
    ResultsOption,
    SetOption,
    TemplatesOption,
    output_option,
)

__all__ = ["app"]


@app.command()
def identify(
    run: Annotated[
        str | None,
        typer.Argument(
            metavar="[RUN[:TEST]]",
            help="A run, or one test of it: path, name, or its beginning; the newest when absent.",
            show_default=False,
        ),
    ] = None,
    results: ResultsOption = RESULTS,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            metavar="NAME",
            help="Only this method (`campaign kinds` lists them); may be given again.",
            show_default=False,
        ),
    ] = None,
    validate: Annotated[
        str | None,
        typer.Option(
            "--validate",
            metavar="RUN[:TEST]",
            help="Predict this one, to which nothing is fitted.",
            show_default=False,
        ),
    ] = None,
    compare_with: Annotated[
        str | None,
        typer.Option(
            "--compare",
            metavar="RUN[:TEST]",
            help="Fit the same model to this one, and say what has changed.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option("BENCH.toml", "Write the rig's bench file with what was identified."),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(
            "--page",
            metavar="DIR",
            help="Where the page goes; RUN-identification beside the archive when absent.",
            show_default=False,
        ),
    ] = None,
    changes: SetOption = None,
    templates: TemplatesOption = None,
    formats: FormatOption = None,
    open_it: OpenOption = False,
) -> None:
    """Identify a rig from its recordings: parameters, intervals, and what they rest on."""
    from campaign.cli.identify import identify_run

    made, code = identify_run(
        run,
        results,
        models=model or (),
        validate=validate,
        compare=compare_with,
        bench=output,
        page=page,
        settings=changes or (),
        templates=templates,
        formats=formats or (),
        open_it=open_it,
    )
    print_line(str(made))
    raise typer.Exit(code)


@app.command()
def trend(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN RUN RUN...",
            help="Three runs of one rig or more, in any order: paths, names, or their beginnings.",
            show_default=False,
        ),
    ],
    results: ResultsOption = RESULTS,
    over: Annotated[
        str,
        typer.Option(
            "--over",
            metavar="WHAT",
            help="What numbers are held against: time, order, temperature (a channel, or a tag "
            "temperature=23.5), a tag NAME=NUMBER, or one of the numbers that the runs found.",
        ),
    ] = "time",
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            metavar="NAME",
            help="Follow what this method identifies, too (`campaign kinds` lists them); "
            "may be given again.",
            show_default=False,
        ),
    ] = None,
    exchanged: Annotated[
        list[str] | None,
        typer.Option(
            "--exchanged",
            metavar="SOURCE@RUN",
            help="From this run on a systematic part is another piece's, although all benches say "
            "the same: the `torque constant` of a motor that was exchanged; may be given again.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option("DIR", "Where to write it; beside the last run when absent."),
    ] = None,
    templates: TemplatesOption = None,
    formats: FormatOption = None,
    open_it: OpenOption = False,
) -> None:
    """Say which numbers of a rig drift or jump over its runs, or follow the temperature."""
    from campaign.cli.trend import trend_of_archives

    page, code = trend_of_archives(
        runs,
        results,
        output,
        over,
        model or (),
        exchanged or (),
        templates,
        formats or (),
        open_it=open_it,
    )
    print_line(str(page))
    raise typer.Exit(code)
