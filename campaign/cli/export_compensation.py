"""`campaign export-compensation`: a compensation of a bench as controller code."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from campaign import __version__
from campaign.cli.check import CheckedLoop, loops_checked
from campaign.cli.output import print_line, print_warning
from campaign.controller_code.compensation import SampledCompensation, trial_inputs
from campaign.controller_code.targets import targets
from campaign.errors import UsageError, writing
from campaign.physics.bench_knowledge import KnownValue
from campaign.physics.complete import CompleteBench
from campaign.protocol.bench_file import bench_source, simulable
from campaign.protocol.limit_check import margins_in_words
from campaign.text import number
from campaign.trial import leaves


def export_compensation(bench: str, name: str, target: str, output: Path) -> list[Path]:
    """Write code and its test, with inputs and torques of this program, into `output`.

    Raises UsageError for an unknown bench, compensation or target, for a bench that is not sampled,
    and for a model without a step function in the target's language.
    """
    known = targets()
    if target not in known:
        raise UsageError(f"--to {target}: there are {', '.join(known)}")
    compensation = SampledCompensation.of(simulable(bench), name)
    head = list(_head(bench, compensation))
    texts = known[target].write(compensation, head, trial_inputs(compensation))
    with writing(f"--output {output}"):
        output.mkdir(parents=True, exist_ok=True)
        for file, text in texts.items():
            (output / file).write_text(text, encoding="utf-8", newline="\n")
    for line in head:
        print_line(line)
    low = [each.verdict for each in _loops(compensation.bench, name) if each.verdict != "fine"]
    if low:
        print_warning(f"{len(low)} of its loops are not fine: {'; '.join(dict.fromkeys(low))}")
    return [output / file for file in texts]


def _head(bench: str, made: SampledCompensation) -> Iterator[str]:
    """Header lines: source of each number, and the margins of the loops."""
    source = bench_source(bench)
    its = made.bench
    yield f"The compensation '{made.name}' of the bench '{its.name}', by campaign {__version__}."
    yield f"Bench file: {bench}, SHA-256 {hashlib.sha256(source.text.encode()).hexdigest()[:16]}"
    yield f"Sampled every {number(1e3 * float(made.controller.period[0]), 4)} ms; SI units."
    if (run := its.known.identified) is not None:
        yield f"Measured values: from {run.run}, digest {run.digest[:16]}"
    options = its.compensation[made.name].model_dump(mode="json", exclude_defaults=True)
    for path, value in leaves(options):
        if value is not None and value not in ([], ()):
            known = its.known.values.get(f"compensation.{made.name}.{path}")
            yield f"{path} = {value}" + ("" if known is None else f" ({_uncertainty(known)})")
    for each in _loops(its, made.name):
        margins = each.verdict if each.margins is None else margins_in_words(each.margins)
        yield f"Loop, {each.regime}, {each.mode} command: {margins}"
    yield "Not included: delays and resolutions of sensors; the rate loop."


def _uncertainty(known: KnownValue) -> str:
    """Text of an interval or standard deviation (SI), and the origin."""
    if known.interval is not None:
        low, high = (number(float(end), 6) for end in known.interval)
        return f"95 %: {low} to {high}; {known.origin}"
    deviation = known.standard_deviation
    return known.origin if deviation is None else f"± {number(deviation, 3)}, 1σ; {known.origin}"


def _loops(bench: CompleteBench, name: str) -> list[CheckedLoop]:
    return [each for each in loops_checked(bench) if each.compensation == name]
