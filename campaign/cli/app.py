"""Options of the program, and the commands that plan and execute.

`archive_commands` adds commands on archived runs; `bench_commands` adds commands on benches and on
the installation. `GROUPS` sets the heading of each command in `--help`. Commands import heavy
modules themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

import campaign
from campaign.cli import parameters as given
from campaign.cli.output import open_page, paged, print_line, redirect_prints
from campaign.cli.parameters import RESULTS, flag, option, several
from campaign.errors import ExitCode

GROUPS = {
    "Experiments": ("init", "plan", "run", "resume", "rerun", "import"),
    "Results": ("list", "show", "report", "identify", "compare", "trend", "index", "export"),
    "Benches": ("kinds", "schema", "model", "check", "calibrate", "fingerprint"),
    "Controllers": ("export-compensation",),
    "Archives": ("verify", "sign"),
    "Hardware": ("device", "stop", "status"),
    "Installation": ("doctor", "warmup", "new"),
}
"""Commands in the help, by heading."""
PAGED = frozenset({"check", "compare", "identify", "kinds", "list", "plan", "show", "trend"})

Ended = ExitCode | Path | tuple[Path | Sequence[Path], ExitCode] | None
"""Return value of a command: exit code, written paths, or both."""
Command = TypeVar("Command", bound=Callable[..., Ended])


class GroupedCommands(TyperGroup):
    """Lists commands by heading; one without a heading comes last."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        left = {name: self.commands[name] for name in self.list_commands(ctx)}
        for heading, names in {**GROUPS, "Others": tuple(left)}.items():
            own = [(name, left.pop(name).get_short_help_str(110)) for name in names if name in left]
            if own:
                with formatter.section(heading):
                    formatter.write_dl(own)


class QuietCommand(TyperCommand):
    """A command with a standard output of its own: prints of plug-ins do not reach it.

    The last lines are the returned paths; `--open` opens the first one.
    """

    def invoke(self, ctx: Any) -> None:
        with self._paging(ctx), redirect_prints():
            ended: Ended = super().invoke(ctx)
            if isinstance(ended, Path):
                ended = ended, ExitCode.DONE
            written, code = ended if isinstance(ended, tuple) else ((), ended or ExitCode.DONE)
            paths = [written] if isinstance(written, Path) else written
            if ctx.params.get("open_it"):
                open_page(paths[0])
            for path in paths:
                print_line(str(path))
            ctx.exit(code)

    def _paging(self, ctx: Any) -> AbstractContextManager[None]:
        """Pager for commands that only print."""
        as_it_comes = ctx.parent.params.get("no_pager") or ctx.params.get("as_json")
        return paged() if self.name in PAGED and not as_it_comes else nullcontext()


app = typer.Typer(
    name="campaign",
    cls=GroupedCommands,
    help="Friction experiments on stabilized servo platforms: run, archive, identify, report.",
    epilog="Exit codes: 0 done; 1 some trials failed; 2 bad usage or protocol; 3 a limit or a "
    "backend fault; 4 a damaged archive; 5 safe state NOT confirmed; 6 no result; "
    "130 interrupted.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # it would bypass the consoles of `cli.output`
    context_settings={"help_option_names": ["-h", "--help"]},
)


def command(name: str | None = None) -> Callable[[Command], Command]:
    """Add a function to the program; the list of commands shows its docstring's first paragraph."""

    def add(function: Command) -> Command:
        summary = (function.__doc__ or "").split("\n\n")[0]
        return app.command(name, cls=QuietCommand, short_help=summary)(function)

    return add


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
        bool, flag("--no-pager", "Print long output without PAGER (less).")
    ] = False,
) -> None:
    pass


@command()
def plan(
    protocol: given.Protocol,
    as_json: given.Json = False,
    details: Annotated[
        bool, flag("--details", "Limits, loops, chosen options, notes of each test.")
    ] = False,
    only: given.Only = None,
    changes: given.Set = None,
    backend: given.Backend = "sim",
    results: given.Results = RESULTS,
    port: given.Port = None,
    source: given.From = None,
    handover: given.Handover = None,
    allow_large: given.Large = False,
    truth: given.Truth = "",
) -> Ended:
    """Show the trials, their time, limits and output files; execute nothing."""
    from campaign.cli.plan import show_plan
    from campaign.cli.prepare import Request, short_settings

    settings = (*(changes or ()), *short_settings(port, source, results, handover))
    request = Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth)
    return show_plan(request, results, as_json=as_json, details=details)


@command()
def run(
    protocol: given.Protocol,
    backend: given.Backend = "sim",
    results: given.Results = RESULTS,
    only: given.Only = None,
    changes: given.Set = None,
    workers: given.Workers = None,
    executor: given.Executor = "",
    tls: given.Tls = None,
    report: given.Report = False,
    port: given.Port = None,
    source: given.From = None,
    handover: given.Handover = None,
    operator: Annotated[str, option("--operator", "NAME", "Person responsible for the run.")] = "",
    note: Annotated[str, option("--note", "TEXT", "Remark to archive with the run.")] = "",
    tags: Annotated[list[str] | None, several("--tag", "WORD", "For `list --tag`")] = None,
    yes: given.Yes = False,
    clear_stop: given.ClearStop = None,
    sign: given.Sign = None,
    allow_large: given.Large = False,
    truth: given.Truth = "",
    check_step: Annotated[
        bool,
        flag(
            "--check-step",
            "Simulate each trial again at half its step, and print the largest change.",
        ),
    ] = False,
    profile: Annotated[bool, flag("--profile", "Print the time by kind of work.")] = False,
    watch: given.Watch = False,
) -> Ended:
    """Execute a protocol and archive it; the archive's path is the last line of the output."""
    from campaign.stopwatch import UNTIMED, Stopwatch, Work

    stopwatch = Stopwatch() if profile else None
    with (stopwatch or UNTIMED).span(Work.IMPORTING):
        from campaign.cli.prepare import Request, short_settings
        from campaign.cli.run import Remarks, run_protocol
        from campaign.cli.run_options import RunOptions
        from campaign.cli.step_check import SETTING

    settings = (*(changes or ()), *short_settings(port, source, results, handover))
    settings += (SETTING,) if check_step else ()
    return run_protocol(
        Request(protocol, tuple(only or ()), settings, backend, allow_large, truth=truth),
        results,
        RunOptions(workers, executor, tls, report, yes, clear_stop, sign, watch),
        remarks=Remarks(operator, note, tuple(tags or ())),
        stopwatch=stopwatch,
    )


@command()
def resume(
    run: given.Run,
    results: given.Results = RESULTS,
    accept_changes: Annotated[
        bool,
        flag(
            "--accept-changes",
            "Continue although protocol, bench, backend or versions have changed.",
        ),
    ] = False,
    workers: given.Workers = None,
    executor: given.Executor = "",
    tls: given.Tls = None,
    report: given.Report = False,
    port: given.Port = None,
    yes: given.Yes = False,
    clear_stop: given.ClearStop = None,
    sign: given.Sign = None,
    watch: given.Watch = False,
) -> Ended:
    """Continue a run that was interrupted, killed or ended by a fault; skip finished trials."""
    from campaign.cli.resume import resume_run
    from campaign.cli.run_options import RunOptions

    return resume_run(
        run,
        results,
        RunOptions(workers, executor, tls, report, yes, clear_stop, sign, watch),
        accept_changes=accept_changes,
        port=port,
    )


@command()
def rerun(
    run: given.Run,
    trial: Annotated[str, typer.Argument(metavar="TRIAL", help="Number or name of the trial.")],
    results: given.Results = RESULTS,
) -> Ended:
    """Simulate one archived trial again, and compare it bit by bit."""
    from campaign.cli.rerun import rerun_trial

    return rerun_trial(run, trial, results)


@command("import")
def import_(
    files: Annotated[
        list[str],
        given.argument(
            "MAPPING",
            "A TOML file that assigns columns to channels and files to trials; with --guess, the "
            "recordings.",
        ),
    ],
    results: given.Results = RESULTS,
    only: given.Only = None,
    changes: given.Set = None,
    workers: given.Workers = None,
    report: given.Report = False,
    guess: Annotated[
        bool, flag("--guess", "Print a first mapping of these files, for correction.")
    ] = False,
    sign: given.Sign = None,
) -> Ended:
    """Import recordings as a run; the archive's path is the last line of the output.

    A mapping is a protocol whose tests were executed by another program: docs/import.md.
    """
    from campaign.cli.import_command import guess_mapping, import_recordings
    from campaign.cli.run_options import RunOptions

    if guess:
        return guess_mapping([Path(each) for each in files])
    return import_recordings(
        files,
        results,
        RunOptions(workers, report=report, sign=sign),
        only=tuple(only or ()),
        changes=tuple(changes or ()),
    )


@command()
def calibrate(
    protocol: given.Protocol,
    results: given.Results = RESULTS,
    output: Annotated[
        Path | None,
        option(
            "--output",
            "FILE",
            "Result file, with the bench beside it; default: a new file in --results.",
        ),
    ] = None,
    workers: Annotated[int | None, given.workers_option("Parallel simulations")] = None,
    leave_out: Annotated[
        bool,
        flag(
            "--leave-one-out/--no-leave-one-out",
            "Fit again without each frequency in turn, to test its prediction.",
        ),
    ] = True,
    fit: Annotated[
        bool,
        flag(
            "--fit/--no-fit",
            "--no-fit: keep the bench, and compute intervals and covariance only.",
        ),
    ] = True,
    propagate: Annotated[
        str,
        option(
            "--propagate",
            "PROTOCOL",
            "Propagate the covariance to the published cells of this other protocol.",
        ),
    ] = "",
) -> Ended:
    """Fit a simulated bench to published cells; the result's path is the last line of output."""
    from campaign.cli.calibrate import calibrate_protocol

    return calibrate_protocol(
        protocol,
        results,
        output,
        workers=workers,
        leave_out=leave_out,
        fit=fit,
        propagated=propagate,
    )
