"""`campaign identify`: parameters of a rig from archived runs."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

from campaign.api.estimate_text import of_unknown_size
from campaign.archive.layout.files import why, write_atomically
from campaign.archive.reading.run_list import find_run
from campaign.axis_kind import axis_terms
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_line, print_note, print_table, print_warning, waiting
from campaign.errors import ExitCode, NoResultError, UsageError, worst_exit_code, writing
from campaign.estimate import Origin
from campaign.identify import experiments_by_model
from campaign.identify.bench_document import bench_text, keys_by_method, nothing_to_write
from campaign.identify.identification import Identification, Section, identify
from campaign.identify.material import ChosenRun, choose
from campaign.identify.page import PAGE, next_measurement, write_identification
from campaign.identify.tables import changes_table, parameter_words, parameters_table
from campaign.interrupts import unwinding
from campaign.report.formats import chosen_formats
from campaign.report.output import refuse_other
from campaign.resources import templates_folder
from campaign.text import count


@unwinding()
def identify_run(
    run: str | None,
    results: Path,
    *,
    models: Sequence[str] = (),
    validate: str | None = None,
    compare: str | None = None,
    bench: Path | None = None,
    page: Path | None = None,
    settings: Sequence[str] = (),
    templates: Path | None = None,
    formats: Sequence[str] = (),
) -> tuple[Path, ExitCode]:
    """Identify; write the page and, on request, the bench file; return the page's path.

    Raises NoResultError, before any file is written, if no method has a result.
    """
    also = chosen_formats(formats)
    run = run or find_run(results).stem
    chosen = choose(results, run)
    unseen = choose(results, validate) if validate else None
    compared = choose(results, compare) if compare else None
    sides = [each for each in (chosen, unseen, compared) if each is not None]
    output = page or _beside(chosen)
    refuse_other(output, PAGE)  # before minutes of work, and before a bench is written
    if bench is not None:
        _refuse_foreign_bench(bench)
    with waiting("reading") as show:
        identification = identify(
            chosen,
            experiments_by_model(),
            models=models,
            validation=unseen,
            compared=compared,
            settings=settings,
            say=lambda text: show(text.split(": ")[0], text),
        )
    if all(each.result is None for each in identification.sections):
        reasons = (f"  {each.model.name}: {each.problem}" for each in identification.sections)
        refused = NoResultError(
            "\n".join([f"{chosen.name}: no parameter can be identified", *reasons])
        )
        refused.exit_code = worst_exit_code([refused.exit_code, *map(_say_damaged, sides)])
        raise refused
    command = _command(run, models, validate, compare, settings)
    text = None
    if bench is not None and not nothing_to_write(identification):
        text = bench_text(identification, command)
    written = bench.name if bench is not None and text is not None else ""
    article = write_identification(
        identification, output, templates_folder(), command, written, templates, also
    )
    if bench is not None and text is not None:
        with writing(bench):  # before printing: the reader of a pipe may end early
            bench.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(bench, text)
    _say(identification)
    if bench is not None:
        if text is None:
            print_note(f"page: {article}")
            raise UsageError("--output: no result has a key in a bench file")
        print_note(f"bench: {bench}")
        for method, keys in keys_by_method(identification).items():
            print_note(f"  {method}: {', '.join(keys)}")
    return article, worst_exit_code([*map(_say_damaged, sides)])


def _say_damaged(chosen: ChosenRun) -> ExitCode:
    return say_damaged(chosen.run.path, chosen.run.damaged)


def _command(
    run: str,
    models: Sequence[str],
    validate: str | None,
    compare: str | None,
    settings: Sequence[str],
) -> str:
    """Command that repeats the identification; with names of runs, without private folders."""
    parts = ["campaign identify", Path(run).name]
    parts += [f"--model {name}" for name in models]
    parts += [f"--validate {Path(validate).name}"] if validate else []
    parts += [f"--compare {Path(compare).name}"] if compare else []
    parts += [f"--set '{text}'" for text in settings]
    return " ".join(parts)


def _beside(chosen: ChosenRun) -> Path:
    test = f"-{chosen.test}" if chosen.test else ""
    return chosen.run.path.with_name(f"{chosen.run.path.stem}{test}-identification")


def _refuse_foreign_bench(path: Path) -> None:
    """Raise UsageError for an existing file that is no bench, e.g. a run or a protocol."""
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file for the bench")
    if not path.exists():
        return
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: {why(error)}") from None
    except ValueError:
        tree = {}
    if "axis" not in tree:
        raise UsageError(f"{path} is there already and is no bench; name another file")


def _say(found: Identification) -> None:
    print_line(_verdict(found))
    with axis_terms(found.bench.sides):
        for section in found.sections:
            if section.result is None:
                print_line(f"{section.model.name}: not identified: {section.problem}")
                continue
            _tell(section)
            if section.problem:
                print_warning(f"not compared: {section.problem}")
            if section.changes and found.compared is not None:
                changes = changes_table(found.chosen.name, found.compared.name, section)
                heads = ("parameter", "before", "after", "change", "verdict")
                print_table(heads, [[str(row[head]) for head in heads] for row in changes.rows])
        advice = next_measurement(found)
        if advice:
            print_line(advice)


def _verdict(found: Identification) -> str:
    """Summary: `11 parameters identified (presliding 9, ramps 2), 4 not determined`."""
    parameters = {each.model.name: each.identified.parameters for each in found.sections}
    open_ones = {
        name: sum(each.estimate.origin is Origin.NOT_DETERMINED for each in own)
        for name, own in parameters.items()
    }
    counts = {name: len(own) - open_ones[name] for name, own in parameters.items()}
    by = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    total = sum(counts.values())
    identified = f"{count(total, 'parameter')} identified"
    return f"{identified}{f' ({by})' if by else ''}, {sum(open_ones.values())} not determined"


def _tell(section: Section) -> None:
    print_line(f"{section.model.name} ({section.model.summary})")
    for warning in section.identified.warnings:
        print_warning(f"{section.model.name}: {warning.text}")
    table = parameters_table([section])
    shown = [[str(row[k]) for k in ("parameter", "value", "unit", "bench")] for row in table.rows]
    print_table(("parameter", "value, 95 %", "unit", "key of the bench"), shown)
    reasons: dict[str, list[str]] = {}
    for each in section.identified.parameters:
        if each.estimate.reason:
            reasons.setdefault(str(each.estimate.reason), []).append(
                parameter_words(each.estimate.name)
            )
    for reason, names in reasons.items():
        print_line(f"{', '.join(names)}: {reason}.")
    for remark in of_unknown_size(each.estimate for each in section.identified.parameters):
        print_line(remark)
