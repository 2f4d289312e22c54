"""What can be typed: commands, arguments and options; those at a bench are in `bench_commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import campaign
from campaign.cli.parameters import (
    RESULTS,
    BackendOption,
    ClearStopOption,
    FromOption,
    LargeOption,
    NewestRunArgument,
    OnlyOption,
    PortOption,
    ProtocolArgument,
    ReportOption,
    ResultsOption,
    RunArgument,
    SetOption,
    SignOption,
    TemplatesOption,
    TruthOption,
    WorkersOption,
    YesOption,
)

app = typer.Typer(
    name="campaign",
    help="Friction experiments on stabilized servo platforms: run, archive, identify, report.",
    epilog="Exit codes: 0 done, 1 some trials failed, 2 bad usage or protocol, 3 a limit or a "
    "backend fault, 4 a damaged archive, 5 safe state NOT confirmed, 130 interrupted.",
    no_args_is_help=True,
    add_completion=False,
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
) -> None:
    pass


@app.command()
def plan(
    protocol: ProtocolArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
    only: OnlyOption = None,
    changes: SetOption = None,
    backend: BackendOption = "sim",
    results: ResultsOption = RESULTS,
    port: PortOption = None,
    source: FromOption = None,
    allow_large: LargeOption = False,
    truth: TruthOption = "",
) -> None:
    """Show the trials, their time and limits, and what would be written; execute nothing."""
    from campaign.cli.plan import show_plan
    from campaign.cli.prepare import Request, short_settings

    settings = (*(changes or ()), *short_settings(port, source, results))
    request = Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth)
    raise typer.Exit(show_plan(request, results, as_json=as_json))


@app.command()
def run(
    protocol: ProtocolArgument,
    backend: BackendOption = "sim",
    results: ResultsOption = RESULTS,
    only: OnlyOption = None,
    changes: SetOption = None,
    workers: WorkersOption = None,
    report: ReportOption = False,
    port: PortOption = None,
    source: FromOption = None,
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
) -> None:
    """Execute a protocol and archive it; the archive's path is the last line of the output."""
    from campaign.stopwatch import UNTIMED, Stopwatch, Work

    stopwatch = Stopwatch() if profile else None
    with (stopwatch or UNTIMED).span(Work.IMPORTING):
        from campaign.cli.prepare import Request, short_settings
        from campaign.cli.run import Remarks, run_protocol
        from campaign.cli.step_check import SETTING

    settings = (*(changes or ()), *short_settings(port, source, results))
    settings += (SETTING,) if check_step else ()
    request = Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth)
    remarks = Remarks(operator, note, tuple(tags or ()))
    raise typer.Exit(
        run_protocol(
            request,
            results,
            workers=workers,
            report=report,
            yes=yes,
            clear_stop=clear_stop,
            remarks=remarks,
            sign=sign,
            stopwatch=stopwatch,
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
    report: ReportOption = False,
    port: PortOption = None,
    yes: YesOption = False,
    clear_stop: ClearStopOption = None,
    sign: SignOption = None,
) -> None:
    """Go on with a run that was interrupted, killed or ended by a fault; repeat nothing done."""
    from campaign.cli.resume import resume_run

    raise typer.Exit(
        resume_run(
            run,
            results,
            accept_changes=accept_changes,
            workers=workers,
            report=report,
            port=port,
            yes=yes,
            clear_stop=clear_stop,
            sign=sign,
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


@app.command()
def calibrate(
    protocol: ProtocolArgument,
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            metavar="FILE",
            help="Where the result goes, with the bench beside it; a new file in --results when "
            "absent.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            min=1,
            max=256,
            help="Simulations at once; one per processor if absent.",
            show_default=False,
        ),
    ] = None,
    leave_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out/--no-leave-one-out",
            help="Refit without each frequency in turn, to see how well it is predicted.",
        ),
    ] = True,
) -> None:
    """Fit a simulated bench to published cells; the result's path is the last line of output."""
    from campaign.cli.calibrate import calibrate_protocol

    raise typer.Exit(
        calibrate_protocol(protocol, results, output, workers=workers, leave_out=leave_out)
    )


@app.command()
def report(
    run: NewestRunArgument = None,
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            metavar="DIR",
            help="Where to write it; RUN-report beside the archive when absent.",
            show_default=False,
        ),
    ] = None,
    templates: TemplatesOption = None,
    open_it: Annotated[bool, typer.Option("--open", help="Open it in a browser.")] = False,
    measure_anew: Annotated[
        bool,
        typer.Option(
            "--measure-anew",
            help="Measure the recordings by this program, not as they were when executed.",
        ),
    ] = False,
) -> None:
    """Write report.html, its tables and its figures, from an archive alone."""
    from campaign.cli.report import report_run

    page, code = report_run(
        run, results, output, templates, open_it=open_it, measure_anew=measure_anew
    )
    typer.echo(page)
    raise typer.Exit(code)


@app.command()
def export(
    run: RunArgument,
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="csv, parquet, mat, or a plug-in's.")
    ],
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            metavar="DIR",
            help="A new folder; RUN-FORMAT beside the archive when absent.",
            show_default=False,
        ),
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
    typer.echo(folder)
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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Check every byte of archives against checksums, journal, format and fingerprints.

    Whoever changes a run can compute its checksums anew: only a signature shows that.
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


@app.command()
def kinds(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="One of them, with its options.", show_default=False),
    ] = None,
) -> None:
    """List experiments, friction models, compensation methods and backends."""
    from campaign.cli.kinds import list_kinds, show_kind

    if name is None:
        list_kinds()
    else:
        show_kind(name)


@app.command()
def warmup() -> None:
    """Compile the engine now, once per installation, instead of in the first run."""
    from campaign.cli.warmup import warm_up

    raise typer.Exit(warm_up())


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
) -> None:
    """Copy the shipped protocols, benches and templates into DIR, or write a bench its own."""
    if bench:
        from campaign.cli.rig_protocols import init_for_bench

        init_for_bench(folder, bench)
        return
    from campaign.cli.archives import init_folder

    init_folder(folder)


@app.command()
def migrate(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Protocols and benches.", show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            metavar="FILE",
            help="A new file to write it to, instead of the one that is read.",
            show_default=False,
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit code 1 if anything would change.")
    ] = False,
) -> None:
    """Bring protocols and benches of an older schema forward, or say what a person must decide."""
    from campaign.cli.migrate import migrate_files

    raise typer.Exit(migrate_files(files, output, check=check))
