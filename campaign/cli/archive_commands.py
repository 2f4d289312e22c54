"""Commands that read archived runs: report, compare, index, export, list, show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from campaign.cli.app import app
from campaign.cli.output import print_line
from campaign.cli.parameters import (
    RESULTS,
    FormatOption,
    JsonOption,
    NewestRunArgument,
    OpenOption,
    ResultsOption,
    RunArgument,
    TemplatesOption,
    output_option,
)
from campaign.errors import UsageError

__all__ = ["app"]


@app.command()
def report(
    run: NewestRunArgument = None,
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        output_option("DIR", "Where to write it; RUN-report beside the archive when absent."),
    ] = None,
    templates: TemplatesOption = None,
    open_it: OpenOption = False,
    measure_anew: Annotated[
        bool,
        typer.Option(
            "--measure-anew",
            help="Measure the recordings by this program, not as they were when executed.",
        ),
    ] = False,
    only_figure: Annotated[
        str | None,
        typer.Option(
            "--only-figure",
            metavar="TEST/KEY",
            help="Only this figure, or all, SVG and CSV; into RUN-figures, or --output. Its "
            "caption on the page names it.",
            show_default=False,
        ),
    ] = None,
    column: Annotated[
        str,
        typer.Option(
            "--column",
            metavar="single|double",
            help="With --only-figure: 88 or 180 mm wide, with PDF, for a paper.",
        ),
    ] = "",
    formats: FormatOption = None,
    trials: Annotated[
        str,
        typer.Option(
            "--trials",
            metavar="WHICH",
            help="Trials that get a page of their own: failed, all, N..M, or N,M.",
            show_default=False,
        ),
    ] = "",
    zoom: Annotated[
        bool,
        typer.Option("--interactive", help="Lines of the page can be zoomed into and read off."),
    ] = False,
    references: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference",
            metavar="CSV",
            help="Reference values to compare with (quantity, value, unit, low, high, test, "
            "conditions); may be given again.",
        ),
    ] = None,
) -> None:
    """Write report.html, its tables and its figures, from an archive alone."""
    from campaign.cli.report import draw_figures, report_run

    if only_figure is not None:
        of_the_page = {
            "--templates": templates,
            "--open": open_it,
            "--format": formats,
            "--trials": trials,
            "--interactive": zoom,
            "--reference": references,
        }
        useless = [option for option, value in of_the_page.items() if value]
        drawings, code = draw_figures(
            run,
            results,
            output,
            only_figure,
            measure_anew=measure_anew,
            useless=useless,
            column=column,
        )
        for drawing in drawings:
            print_line(str(drawing))
        raise typer.Exit(code)
    if column:
        raise UsageError("--column is for --only-figure TEST/KEY, or --only-figure all")
    page, code = report_run(
        run,
        results,
        output,
        templates,
        open_it=open_it,
        measure_anew=measure_anew,
        formats=formats or (),
        trials=trials,
        zoom=zoom,
        references=references or (),
    )
    print_line(str(page))
    raise typer.Exit(code)


@app.command()
def compare(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN RUN...",
            help="The reference, and what is compared with it: paths, names, or their beginnings.",
            show_default=False,
        ),
    ],
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        output_option("DIR", "Where to write it; beside the reference when absent."),
    ] = None,
    exchanged: Annotated[
        list[str] | None,
        typer.Option(
            "--exchanged",
            metavar="SOURCE",
            help="What is not the same in all runs although the benches say so, as `torque "
            "constant` of a motor that was exchanged; may be given again.",
        ),
    ] = None,
    templates: TemplatesOption = None,
    formats: FormatOption = None,
    open_it: OpenOption = False,
) -> None:
    """Say which numbers of runs differ from those of the first, and how sure that is."""
    from campaign.cli.compare import compare_archives

    page, code = compare_archives(
        runs, results, output, exchanged or (), templates, formats or (), open_it=open_it
    )
    print_line(str(page))
    raise typer.Exit(code)


@app.command()
def index(
    results: Annotated[
        Path | None,
        typer.Argument(metavar="[RESULTS]", help="As --results.", show_default=False),
    ] = None,
    folder: ResultsOption = RESULTS,
    open_it: OpenOption = False,
) -> None:
    """Write index.html into a results folder: one searchable page over all its runs."""
    from campaign.cli.index import index_results

    print_line(str(index_results(results or folder, open_it=open_it)))


@app.command()
def export(
    run: RunArgument,
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="csv, parquet, mat, or a plug-in's.")
    ],
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        output_option("DIR", "A new folder; RUN-FORMAT beside the archive when absent."),
    ] = None,
    tests: Annotated[
        list[str] | None,
        typer.Option("--test", metavar="TEST", help="Only this test; may be given again."),
    ] = None,
    trials: Annotated[
        list[int] | None,
        typer.Option("--trial", metavar="N", help="Only this trial; may be given again."),
    ] = None,
) -> None:
    """Write recordings as files of other programs, with a table of the trials beside them."""
    from campaign.cli.export import export_archive

    folder, code = export_archive(run, results, to, output, tests or (), trials or ())
    print_line(str(folder))
    raise typer.Exit(code)


@app.command("list")
def list_command(
    results: ResultsOption = RESULTS,
    protocol: Annotated[
        list[str] | None,
        typer.Option("--protocol", metavar="NAME", help="Runs of it; a pattern will do."),
    ] = None,
    since: Annotated[
        str, typer.Option("--since", metavar="DATE", help="Begun then or later.")
    ] = "",
    until: Annotated[str, typer.Option("--until", metavar="DATE", help="Begun by then.")] = "",
    backend: Annotated[
        list[str] | None, typer.Option("--backend", metavar="NAME", help="Executed by it.")
    ] = None,
    bench: Annotated[
        list[str] | None,
        typer.Option("--bench", metavar="NAME", help="With a test on it; a pattern will do."),
    ] = None,
    status: Annotated[
        list[str] | None,
        typer.Option("--status", metavar="STATUS", help="As `complete` or `failed trials`."),
    ] = None,
    tag: Annotated[
        list[str] | None, typer.Option("--tag", metavar="TAG", help="With every tag given.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the archived runs, the newest first; options but --since and --until may be repeated."""
    from campaign.cli.archives import list_archives
    from campaign.cli.selection import Selection, statuses

    selection = Selection(
        protocols=tuple(protocol or ()),
        since=since,
        until=until,
        backends=tuple(backend or ()),
        benches=tuple(bench or ()),
        statuses=statuses(status or ()),
        tags=tuple(tag or ()),
    )
    list_archives(results, selection, as_json=as_json)


@app.command()
def show(
    run: NewestRunArgument = None,
    results: ResultsOption = RESULTS,
    metrics: Annotated[
        bool,
        typer.Option("--metrics", help="Also what each recording says by itself, with intervals."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show what a run was, how it ended, and all that did not go as planned."""
    from campaign.cli.show import show_archive

    raise typer.Exit(show_archive(run, results, as_json=as_json, metrics=metrics))


@app.command()
def verify(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="A path, a run's name, a unique beginning of it, or a pattern such as '2026-*'.",
            show_default=False,
        ),
    ],
    results: ResultsOption = RESULTS,
    signer: Annotated[
        str | None,
        typer.Option(
            "--signer",
            metavar="NAME",
            help="Who must have signed; needs --allowed-signers.",
            show_default=False,
        ),
    ] = None,
    allowed_signers: Annotated[
        Path | None,
        typer.Option(
            "--allowed-signers",
            metavar="FILE",
            help="Which keys are whose, as ssh-keygen(1) describes it.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check every byte of archives against checksums, journal, format and fingerprints.

    Anyone who changes a run can compute its checksums anew: only a signature shows that.
    """
    from campaign.cli.signature import wanted_signature
    from campaign.cli.verify import verify_archives

    wanted = wanted_signature(signer, allowed_signers)
    raise typer.Exit(verify_archives(runs, results, as_json=as_json, wanted=wanted))


@app.command()
def sign(
    run: RunArgument,
    key: Annotated[
        Path,
        typer.Option(
            "--key",
            metavar="FILE",
            help="A private key of OpenSSH, or a public one whose other half the agent has.",
        ),
    ],
    results: ResultsOption = RESULTS,
    replace: Annotated[
        bool, typer.Option("--replace", help="Set a signature that is there aside.")
    ] = False,
) -> None:
    """Sign a sealed run that is sound: a file RUN.nxs.sig beside it proves who, not when."""
    from campaign.cli.sign import sign_archive

    raise typer.Exit(sign_archive(run, results, key, replace=replace))
