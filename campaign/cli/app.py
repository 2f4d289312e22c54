"""Options of the program, and the commands that plan and execute.

What is asked of archives is in `archive_commands`, of a rig by its runs in `rig_commands`, what is
done once in `setup_commands`, and what is done at a bench in `bench_commands`: each adds its
commands to those of the one before. `GROUPS` says under which heading `--help` lists each.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import campaign
from campaign.cli.parameters import (
    RESULTS,
    BackendOption,
    ClearStopOption,
    ExecutorOption,
    FromOption,
    HandoverOption,
    JsonOption,
    LargeOption,
    OnlyOption,
    PortOption,
    ProtocolArgument,
    ReportOption,
    ResultsOption,
    RunArgument,
    SetOption,
    SignOption,
    TlsOption,
    TruthOption,
    WatchOption,
    WorkersOption,
    YesOption,
    output_option,
    workers_option,
)

GROUPS = {
    "Experiments": ("init", "plan", "run", "resume", "rerun", "import"),
    "Results": ("list", "show", "report", "identify", "compare", "trend", "index", "export"),
    "Benches": ("kinds", "schema", "model", "check", "calibrate", "fingerprint"),
    "Controllers": ("export-compensation",),
    "Archives": ("verify", "sign"),
    "Hardware": ("device", "stop", "status"),
    "Installation": ("doctor", "warmup", "new"),
}
"""Commands as the help lists them, by heading."""


class GroupedCommands(TyperGroup):
    """Lists commands by heading; one without a heading comes last."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        left = {name: self.commands[name] for name in self.list_commands(ctx)}
        for heading, names in {**GROUPS, "Others": tuple(left)}.items():
            own = [(name, left.pop(name).get_short_help_str(110)) for name in names if name in left]
            if own:
                with formatter.section(heading):
                    formatter.write_dl(own)


app = typer.Typer(
    name="campaign",
    cls=GroupedCommands,
    help="Friction experiments on stabilized servo platforms: run, archive, identify, report.",
    epilog="Exit codes: 0 done, 1 some trials failed, 2 bad usage or protocol, 3 a limit or a "
    "backend fault, 4 a damaged archive, 5 safe state NOT confirmed, 6 no result, "
    "130 interrupted.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its consoles would be none of ours: `cli.output`
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from campaign.execution.provenance import own_versions

        typer.echo(f"campaign {campaign.__version__}")
        typer.echo(", ".join(f"{name} {number}" for name, number in own_versions().items()))
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    no_pager: Annotated[
        bool, typer.Option("--no-pager", help="Show long output as it comes, not by PAGER (less).")
    ] = False,
) -> None:
    pass


@app.command()
def plan(
    protocol: ProtocolArgument,
    as_json: JsonOption = False,
    details: Annotated[
        bool, typer.Option("--details", help="Limits, loops, chosen options, notes of each test.")
    ] = False,
    only: OnlyOption = None,
    changes: SetOption = None,
    backend: BackendOption = "sim",
    results: ResultsOption = RESULTS,
    port: PortOption = None,
    source: FromOption = None,
    handover: HandoverOption = None,
    allow_large: LargeOption = False,
    truth: TruthOption = "",
) -> None:
    """Show the trials, their time and limits, and what would be written; execute nothing."""
    from campaign.cli.plan import show_plan
    from campaign.cli.prepare import Request, short_settings

    settings = (*(changes or ()), *short_settings(port, source, results, handover))
    request = Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth)
    raise typer.Exit(show_plan(request, results, as_json=as_json, details=details))


@app.command()
def run(
    protocol: ProtocolArgument,
    backend: BackendOption = "sim",
    results: ResultsOption = RESULTS,
    only: OnlyOption = None,
    changes: SetOption = None,
    workers: WorkersOption = None,
    executor: ExecutorOption = "",
    tls: TlsOption = None,
    report: ReportOption = False,
    port: PortOption = None,
    source: FromOption = None,
    handover: HandoverOption = None,
    operator: Annotated[
        str, typer.Option("--operator", metavar="NAME", help="Who is responsible for the run.")
    ] = "",
    note: Annotated[
        str, typer.Option("--note", metavar="TEXT", help="Anything worth keeping with the run.")
    ] = "",
    tags: Annotated[
        list[str] | None,
        typer.Option("--tag", metavar="WORD", help="To find the run by; may be given again."),
    ] = None,
    yes: YesOption = False,
    clear_stop: ClearStopOption = None,
    sign: SignOption = None,
    allow_large: LargeOption = False,
    truth: TruthOption = "",
    check_step: Annotated[
        bool,
        typer.Option(
            "--check-step",
            help="Simulate each trial once more at half its step, and say what that changes.",
        ),
    ] = False,
    profile: Annotated[
        bool, typer.Option("--profile", help="Say at the end where the time went.")
    ] = False,
    watch: WatchOption = False,
) -> None:
    """Execute a protocol and archive it; the archive's path is the last line of the output."""
    from campaign.stopwatch import UNTIMED, Stopwatch, Work

    stopwatch = Stopwatch() if profile else None
    with (stopwatch or UNTIMED).span(Work.IMPORTING):
        from campaign.cli.cluster import ExecutorChoice
        from campaign.cli.prepare import Request, short_settings
        from campaign.cli.run import Remarks, run_protocol
        from campaign.cli.step_check import SETTING

    settings = (*(changes or ()), *short_settings(port, source, results, handover))
    settings += (SETTING,) if check_step else ()
    request = Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth)
    remarks = Remarks(operator, note, tuple(tags or ()))
    raise typer.Exit(
        run_protocol(
            request,
            results,
            workers=workers,
            where=ExecutorChoice(executor, tls),
            report=report,
            yes=yes,
            clear_stop=clear_stop,
            remarks=remarks,
            sign=sign,
            stopwatch=stopwatch,
            watch=watch,
        )
    )


@app.command()
def resume(
    run: RunArgument,
    results: ResultsOption = RESULTS,
    accept_changes: Annotated[
        bool,
        typer.Option(
            "--accept-changes",
            help="Go on although protocol, bench, backend or versions have changed since.",
        ),
    ] = False,
    workers: WorkersOption = None,
    executor: ExecutorOption = "",
    tls: TlsOption = None,
    report: ReportOption = False,
    port: PortOption = None,
    yes: YesOption = False,
    clear_stop: ClearStopOption = None,
    sign: SignOption = None,
    watch: WatchOption = False,
) -> None:
    """Go on with a run that was interrupted, killed or ended by a fault; repeat nothing done."""
    from campaign.cli.cluster import ExecutorChoice
    from campaign.cli.resume import resume_run

    raise typer.Exit(
        resume_run(
            run,
            results,
            accept_changes=accept_changes,
            workers=workers,
            where=ExecutorChoice(executor, tls),
            report=report,
            port=port,
            yes=yes,
            clear_stop=clear_stop,
            sign=sign,
            watch=watch,
        )
    )


@app.command()
def rerun(
    run: RunArgument,
    trial: Annotated[str, typer.Argument(metavar="TRIAL", help="Its number, or its name.")],
    results: ResultsOption = RESULTS,
) -> None:
    """Execute one archived trial again on the simulated bench, and compare it bit by bit."""
    from campaign.cli.rerun import rerun_trial

    raise typer.Exit(rerun_trial(run, trial, results))


@app.command("import")
def import_(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="MAPPING",
            help="A TOML file that says what columns are and which files are which trials; with "
            "--guess the recordings themselves.",
            show_default=False,
        ),
    ],
    results: ResultsOption = RESULTS,
    only: OnlyOption = None,
    changes: SetOption = None,
    workers: WorkersOption = None,
    report: ReportOption = False,
    guess: Annotated[
        bool,
        typer.Option("--guess", help="Print a first mapping of these files, to be corrected."),
    ] = False,
    sign: SignOption = None,
) -> None:
    """Make a run of recordings from elsewhere; the archive's path is the last line of the output.

    A mapping is a protocol whose tests were executed by another program: docs/import.md.
    """
    from campaign.cli.import_command import guess_mapping, import_recordings

    if guess:
        raise typer.Exit(guess_mapping([Path(each) for each in files]))
    raise typer.Exit(
        import_recordings(
            files,
            results,
            only=tuple(only or ()),
            changes=tuple(changes or ()),
            workers=workers,
            report=report,
            sign=sign,
        )
    )


@app.command()
def calibrate(
    protocol: ProtocolArgument,
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        output_option(
            "FILE",
            "Where the result goes, with the bench beside it; a new file in --results when absent.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        workers_option("Simulations at once"),
    ] = None,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out/--no-leave-one-out",
            help="Refit without each frequency in turn, to see how well it is predicted.",
        ),
    ] = True,
    fit: Annotated[
        bool,
        typer.Option(
            "--fit/--no-fit",
            help="Without: the bench stays as it is, and intervals and covariance are worked out.",
        ),
    ] = True,
    propagate: Annotated[
        str,
        typer.Option(
            "--propagate",
            metavar="PROTOCOL",
            help="Carry the covariance to the published cells of this protocol, not of its own.",
        ),
    ] = "",
) -> None:
    """Fit a simulated bench to published cells; the result's path is the last line of output."""
    from campaign.cli.calibrate import calibrate_protocol

    raise typer.Exit(
        calibrate_protocol(
            protocol,
            results,
            output,
            workers=workers,
            leave_out=leave_out,
            fit=fit,
            propagated=propagate,
        )
    )
