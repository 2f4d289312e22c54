"""Missing values of benches, and their effect on a plan.

A bench states facts. A backend may need more values than the file states: this is an error before
planning. Quantities that a plan cannot predict result in warnings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.errors import Problem, ProtocolError
from campaign.physics.bench import Bench
from campaign.physics.complete import IncompleteBenchError, lacking
from campaign.physics.limits import unpredicted
from campaign.protocol.expand import ExpandedTest
from campaign.protocol.schema import Protocol, Test


def check_benches(
    protocol: Protocol, needs: Sequence[str], who: str, only: Sequence[str] = ()
) -> None:
    """Raise ProtocolError, at the bench's file, with all missing values that `who` needs.

    Args:
        needs: dotted paths of a bench.
        only: names of the tests to check; all if empty.
    """
    problems: list[Problem] = []
    for test in protocol.tests:
        if not only or test.entry.name in only:
            problems += _problems(test, needs, who)
    if problems:
        raise ProtocolError(list(dict.fromkeys(problems)))


def _problems(test: Test, needs: Sequence[str], who: str) -> Iterator[Problem]:
    bench = Bench.model_validate(test.bench)
    swept = {".".join(map(str, axis.keys)) for axis in test.axes if axis.of_bench}
    paths = [path for path in lacking(bench, needs) if path not in swept]
    if paths:
        error = IncompleteBenchError.of(bench, paths, who)
        message = f"{error}. Add it; to analyse recordings that exist it is not needed"
        yield test.bench_origin.problem((), "value", message)


def not_predicted(expanded: ExpandedTest) -> tuple[str, ...]:
    """Warnings about quantities that a plan cannot predict for lack of values of the benches."""
    gaps: dict[str, None] = {}
    seen: set[tuple[int, str]] = set()
    for trial, bench in zip(expanded.trials, expanded.benches, strict=True):
        mode = trial.task.mode
        if mode not in ("rate", "torque") or (id(bench), mode) in seen:
            continue
        seen.add((id(bench), mode))
        if unknown := unpredicted(bench, trial.task):
            paths = tuple(dict.fromkeys(path for each in unknown.values() for path in each))
            gaps[_sentence(f"its {' and '.join(unknown)} cannot be predicted", bench, paths)] = None
        if paths := lacking(bench):
            gaps[_sentence("the margins of its loops are not known", bench, paths)] = None
    return tuple(gaps)


def _sentence(what: str, bench: Bench, paths: Sequence[str]) -> str:
    return f"{what}: the bench '{bench.name}' does not say {', '.join(paths)}"
