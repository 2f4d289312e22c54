"""Commands that read archived runs: report, compare, identify, trend, index, export, list, show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from campaign.cli import parameters as given
from campaign.cli.app import Ended, app, command
from campaign.cli.parameters import RESULTS, argument, flag, option, several
from campaign.errors import UsageError

__all__ = ["app"]


@command()
def report(
    run: given.NewestRun = None,
    results: given.Results = RESULTS,
    output: Annotated[
        Path | None,
        option("--output", "DIR", "Output folder; default: RUN-report beside the archive."),
    ] = None,
    templates: given.Templates = None,
    open_it: given.Open = False,
    measure_anew: Annotated[
        bool,
        flag(
            "--measure-anew",
            "Compute the metrics of the recordings again, with this version.",
        ),
    ] = False,
    only_figure: Annotated[
        str | None,
        option(
            "--only-figure",
            "TEST/KEY",
            "Write only this figure, or all, as SVG and CSV into RUN-figures or --output. "
            "Captions on the page state TEST/KEY.",
        ),
    ] = None,
    column: Annotated[
        str,
        option(
            "--column",
            "single|double",
            "With --only-figure: 88 or 180 mm wide, also as PDF, for a paper.",
        ),
    ] = "",
    formats: given.Format = None,
    trials: Annotated[
        str,
        option(
            "--trials",
            "WHICH",
            "Trials with their own page: failed, all, N..M, or N,M.",
        ),
    ] = "",
    zoom: Annotated[
        bool, flag("--interactive", "Add zoom and cursor values to lines of the page.")
    ] = False,
    references: Annotated[
        list[Path] | None,
        several(
            "--reference",
            "CSV",
            "Reference values to compare with (quantity, value, unit, low, high, test, conditions)",
        ),
    ] = None,
) -> Ended:
    """Write report.html, its tables and its figures from an archive."""
    from campaign.cli.report import draw_figures, report_run

    if only_figure is None:
        if column:
            raise UsageError("--column is for --only-figure TEST/KEY, or --only-figure all")
        return report_run(
            run,
            results,
            output,
            templates,
            measure_anew=measure_anew,
            formats=formats or (),
            trials=trials,
            zoom=zoom,
            references=references or (),
        )
    of_the_page = {
        "--templates": templates,
        "--open": open_it,
        "--format": formats,
        "--trials": trials,
        "--interactive": zoom,
        "--reference": references,
    }
    if useless := [name for name, value in of_the_page.items() if value]:
        raise UsageError(
            f"--only-figure writes a figure and no page; leave {', '.join(useless)} out"
        )
    return draw_figures(run, results, output, only_figure, measure_anew=measure_anew, column=column)


@command()
def compare(
    runs: Annotated[
        list[str],
        argument(
            "RUN RUN...",
            "The reference, then the runs to compare: paths, names, or their beginnings.",
        ),
    ],
    results: given.Results = RESULTS,
    output: Annotated[
        Path | None,
        option("--output", "DIR", "Output folder; default: beside the reference."),
    ] = None,
    exchanged: Annotated[
        list[str] | None,
        several(
            "--exchanged",
            "SOURCE",
            "Difference that the benches do not state, such as `torque constant` of another motor",
        ),
    ] = None,
    templates: given.Templates = None,
    formats: given.Format = None,
    open_it: given.Open = False,
) -> Ended:
    """List the numbers of runs that differ from those of the first, with significance."""
    from campaign.cli.compare import compare_archives

    return compare_archives(runs, results, output, exchanged or (), templates, formats or ())


@command()
def identify(
    run: Annotated[
        str | None,
        argument(
            "[RUN[:TEST]]",
            "A run, or one test of it: path, name, or its beginning; default: the newest run.",
        ),
    ] = None,
    results: given.Results = RESULTS,
    model: Annotated[
        list[str] | None,
        several("--model", "NAME", "Only this method (`campaign kinds` lists them)"),
    ] = None,
    validate: Annotated[
        str | None,
        option(
            "--validate",
            "RUN[:TEST]",
            "Validate with this run; it is not fitted.",
        ),
    ] = None,
    compare_with: Annotated[
        str | None,
        option(
            "--compare",
            "RUN[:TEST]",
            "Fit the same model to this run, and list the changes.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        option("--output", "BENCH.toml", "Write the rig's bench file with the identified values."),
    ] = None,
    page: Annotated[
        Path | None,
        option(
            "--page",
            "DIR",
            "Folder of the page; default: RUN-identification beside the archive.",
        ),
    ] = None,
    changes: given.Set = None,
    templates: given.Templates = None,
    formats: given.Format = None,
    open_it: given.Open = False,
) -> Ended:
    """Identify parameters of a rig from its recordings, with intervals and evidence."""
    from campaign.cli.identify import identify_run

    return identify_run(
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
    )


@command()
def trend(
    runs: Annotated[
        list[str],
        argument(
            "RUN RUN RUN...",
            "At least three runs of one rig, in any order: paths, names, or their beginnings.",
        ),
    ],
    results: given.Results = RESULTS,
    over: Annotated[
        str,
        option(
            "--over",
            "WHAT",
            "Covariate: time, order, temperature (a channel, or a tag temperature=23.5), "
            "a tag NAME=NUMBER, or a result of the runs.",
        ),
    ] = "time",
    model: Annotated[
        list[str] | None,
        several(
            "--model",
            "NAME",
            "Include the parameters of this method (`campaign kinds` lists them)",
        ),
    ] = None,
    exchanged: Annotated[
        list[str] | None,
        several(
            "--exchanged",
            "SOURCE@RUN",
            "Difference from this run on, such as the `torque constant` of an exchanged motor",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        option("--output", "DIR", "Output folder; default: beside the last run."),
    ] = None,
    templates: given.Templates = None,
    formats: given.Format = None,
    open_it: given.Open = False,
) -> Ended:
    """List the numbers of a rig that drift, jump, or follow the temperature over its runs."""
    from campaign.cli.trend import trend_of_archives

    return trend_of_archives(
        runs,
        results,
        output,
        over,
        model or (),
        exchanged or (),
        templates,
        formats or (),
    )


@command()
def index(
    results: Annotated[Path | None, argument("[RESULTS]", "Same as --results.")] = None,
    folder: given.Results = RESULTS,
    open_it: given.Open = False,
) -> Ended:
    """Write index.html into a results folder: one searchable page over all its runs."""
    from campaign.report.index.page import write_index
    from campaign.resources import templates_folder

    return write_index(results or folder, templates_folder())


@command()
def export(
    run: given.Run,
    to: Annotated[str, option("--to", "FORMAT", "csv, parquet, mat, or of a plug-in.")],
    results: given.Results = RESULTS,
    output: Annotated[
        Path | None,
        option("--output", "DIR", "A new folder; default: RUN-FORMAT beside the archive."),
    ] = None,
    tests: Annotated[list[str] | None, several("--test", "TEST", "Only this test")] = None,
    trials: Annotated[list[int] | None, several("--trial", "N", "Only this trial")] = None,
) -> Ended:
    """Write recordings as files of other programs, with a table of the trials."""
    from campaign.cli.export import export_archive

    return export_archive(run, results, to, output, tests or (), trials or ())


@command("list")
def list_command(
    results: given.Results = RESULTS,
    protocol: Annotated[
        list[str] | None,
        option("--protocol", "NAME", "Protocol: a name or a pattern."),
    ] = None,
    since: Annotated[str, option("--since", "DATE", "Earliest start.")] = "",
    until: Annotated[str, option("--until", "DATE", "Latest start.")] = "",
    backend: Annotated[list[str] | None, option("--backend", "NAME", "Backend of the run.")] = None,
    bench: Annotated[
        list[str] | None,
        option("--bench", "NAME", "Bench of a test: a name or a pattern."),
    ] = None,
    status: Annotated[
        list[str] | None,
        option("--status", "STATUS", "Status, e.g. `complete` or `failed trials`."),
    ] = None,
    tag: Annotated[list[str] | None, option("--tag", "TAG", "With all given tags.")] = None,
    as_json: given.Json = False,
) -> None:
    """List the archived runs, the newest first; options but --since and --until may be repeated."""
    from campaign.cli.archives import Selection, list_archives, statuses

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


@command()
def show(
    run: given.NewestRun = None,
    results: given.Results = RESULTS,
    metrics: Annotated[
        bool, flag("--metrics", "Also show the metrics of each recording, with intervals.")
    ] = False,
    as_json: given.Json = False,
) -> Ended:
    """Show description and ending of a run, and all deviations from the plan."""
    from campaign.cli.show import show_archive

    return show_archive(run, results, as_json=as_json, metrics=metrics)


@command()
def verify(
    runs: Annotated[
        list[str],
        argument(
            "RUN...",
            "A path, a run's name, a unique beginning of it, or a pattern such as '2026-*'.",
        ),
    ],
    results: given.Results = RESULTS,
    signer: Annotated[
        str | None,
        option("--signer", "NAME", "Required signer; needs --allowed-signers."),
    ] = None,
    allowed_signers: Annotated[
        Path | None,
        option("--allowed-signers", "FILE", "Keys of signers, in the format of ssh-keygen(1)."),
    ] = None,
    as_json: given.Json = False,
) -> Ended:
    """Check every byte of archives against checksums, journal, format and fingerprints.

    Checksums do not show a change on purpose, as they can be recomputed; a signature does.
    """
    from campaign.cli.verify import verify_archives, wanted_signature

    wanted = wanted_signature(signer, allowed_signers)
    return verify_archives(runs, results, as_json=as_json, wanted=wanted)


@command()
def sign(
    run: given.Run,
    key: Annotated[
        Path,
        option(
            "--key",
            "FILE",
            "A private OpenSSH key, or a public one with the private key in the agent.",
        ),
    ],
    results: given.Results = RESULTS,
    replace: Annotated[bool, flag("--replace", "Rename an existing signature.")] = False,
) -> Ended:
    """Sign a sealed, sound run: a file RUN.nxs.sig beside it proves who signed, not when."""
    from campaign.cli.sign import sign_archive

    return sign_archive(run, results, key, replace=replace)
