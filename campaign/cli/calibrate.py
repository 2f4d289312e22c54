"""`campaign calibrate`: fit a bench's unknowns to published cells."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from campaign.archive.layout.files import write_atomically
from campaign.calibration.document import bench_text, interruption, known_entries, result_text
from campaign.calibration.outcome import CalibrationOutcome, calibrate
from campaign.calibration.problem import make_problem
from campaign.calibration.targets import shortest
from campaign.cli.output import print_line, print_note, print_table, print_warning, waiting
from campaign.cli.prepare import find_protocol
from campaign.errors import ExitCode, UsageError, writing
from campaign.estimation.multi_start import Progress, agreeing
from campaign.experiments import experiments
from campaign.interrupts import unwinding
from campaign.physics.complete import PURPOSES
from campaign.protocol import Protocol, load_protocol
from campaign.protocol.missing_values import check_benches
from campaign.published.values import Published, published_values
from campaign.resources import protocols_folder

SHOWN_PROBLEMS = 5  # of the simulation; the result has all


@unwinding()
def calibrate_protocol(
    name: str,
    results: Path,
    output: Path | None,
    *,
    workers: int | None,
    leave_out: bool,
    fit: bool = True,
    propagated: str = "",
) -> ExitCode:
    """Fit; write result and bench; the result's path is the last line of output."""
    path = find_protocol(name)
    protocol = load_protocol(path, experiments(), shipped=protocols_folder())
    other = None
    if propagated:
        other_path = find_protocol(propagated)
        other = load_protocol(other_path, experiments(), shipped=protocols_folder())
    check_benches(protocol, tuple(PURPOSES), "a calibration, which simulates,")
    problem = make_problem(protocol, _published(protocol))
    for warning in problem.warnings:
        print_warning(warning)
    result, bench = _files(path, results, output)
    fitted, document = shortest(problem.targets, problem.published), _document(protocol, bench)
    source, space = problem.calibration.bench, problem.space
    # Check before hours of work that the bench file can be edited.
    unknown = {path: {"origin": "fitted"} for p in space.parameters for path, _ in p.fields}
    bench_text(source, space, space.present, {"fitted": fitted, "values": unknown})
    with waiting("evaluating the bench as it is") as show:
        outcome = calibrate(
            problem,
            experiments(),
            workers=workers or os.cpu_count() or 1,
            display=lambda progress: show(progress.phase, _line(progress)),
            leave_out=leave_out,
            fit=fit,
            propagated=other,
        )
    known = known_entries(outcome, fitted, document)
    calibrated = bench_text(source, space, outcome.values, known)
    for path, text in ((bench, calibrated), (result, result_text(outcome, bench.name, calibrated))):
        with writing(path):
            write_atomically(path, text)
    _say(outcome)
    print_note(f"bench: {bench}")
    print_line(str(result))
    return ExitCode.INTERRUPTED if outcome.interrupted else ExitCode.DONE


def _document(protocol: Protocol, bench: Path) -> str:
    """Name of the published values for the bench file: `thesis`, or a path relative to the file."""
    if protocol.published == "thesis":
        return protocol.published
    file = protocol.path.parent / protocol.published
    return Path(os.path.relpath(file, bench.parent)).as_posix()


def _published(protocol: Protocol) -> Published:
    if protocol.published == "none":
        raise UsageError(f"{protocol.path}: a calibration needs published values, not 'none'")
    if protocol.published == "thesis":
        return published_values()
    return published_values(protocol.sources[protocol.published], protocol.published)


def _files(path: Path, results: Path, output: Path | None) -> tuple[Path, Path]:
    """Paths of result and bench; without --output, new ones that overwrite nothing."""
    if output is not None:
        pair = output, output.with_name(f"{output.stem}-bench.toml")
    else:
        number = 1
        while True:
            stem = f"{path.stem}-calibration{'' if number == 1 else f'-{number}'}"
            pair = results / f"{stem}.toml", results / f"{stem}-bench.toml"
            if not any(file.exists() for file in pair):
                break
            number += 1
    with writing(pair[0].parent):
        pair[0].parent.mkdir(parents=True, exist_ok=True)
    if pair[0].is_dir() or not os.access(pair[0].parent, os.W_OK):
        raise UsageError(f"{pair[0]}: cannot be written; name another file with --output")
    return pair


def _line(progress: Progress) -> str:
    return (
        f"{progress.phase}: {progress.evaluations} evaluations, cost {progress.cost:.4g}, "
        f"best {progress.best:.4g}"
    )


def _say(outcome: CalibrationOutcome) -> None:
    problem = outcome.problem
    print_table(("parameter", "value", "95 % interval", "note"), _rows(outcome))
    if outcome.interrupted:
        print_warning(interruption(outcome))
    for problem_text in outcome.fitted.problems[:SHOWN_PROBLEMS]:
        print_warning(f"with these values: {problem_text}")
    print_note(
        f"cost {outcome.cost_before:.4g} before, {outcome.cost:.4g} now, on "
        f"{len(problem.targets)} cells; {agreeing(outcome.starts)} of {len(outcome.starts)} "
        f"starts agree; {outcome.evaluations} evaluations"
    )


def _rows(outcome: CalibrationOutcome) -> Iterator[tuple[str, ...]]:
    certainty = outcome.uncertainty
    for index, parameter in enumerate(outcome.problem.space.parameters):
        unknown, share = parameter.unknown, float(outcome.shares[index])
        interval, note = "", ""
        if certainty is not None:
            half, limit = float(certainty.half_width[index]), float(certainty.limit[index])
            if half == half and half < 10.0:
                ends = (float(certainty.low[index]), float(certainty.high[index]))
                interval = " to ".join(str(parameter.text(unknown.value(end))) for end in ends)
            if certainty.bound[index]:
                note = f"at its {certainty.bound[index]} bound"
                if limit == limit:
                    side = "at most" if certainty.bound[index] == "lower" else "at least"
                    interval = f"{side} {parameter.text(unknown.value(limit))}"
            elif certainty.open[index]:
                note = "not determined"
        yield parameter.name, str(parameter.text(unknown.value(share))), interval, note
