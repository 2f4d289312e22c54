"""Differences between two runs besides their results: protocol, bench, backend, versions.

Field by field, in display units. One of them, or the bench, causes a declared difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import option_quantity, plain
from campaign.archive.reading.run_reader import RunReader
from campaign.comparison.same_quantity import PairedTest, Pairing
from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import number_at
from campaign.physics.truth import simulated
from campaign.trial import Tree, canonical_json

NOT_MOVING = ("description", "known")
"""Tables of a bench that do not affect the motion; `known` is reported separately."""
NONE = "–"


@dataclass(frozen=True)
class Change:
    """One field that differs.

    Attributes:
        where: `run`, `backend`, `versions`, or name of a test, also with `: bench` or `: truth`.
        path: dotted path; for a protocol or a bench as in `--set`.
    """

    where: str
    path: str
    reference: str
    other: str


def changes(reference: RunReader, other: RunReader, pairing: Pairing) -> tuple[Change, ...]:
    """All differences; one common to several tests, e.g. of their bench, only for the first."""
    differences: dict[tuple[str, str, str], Change] = {}
    for change in (*_of_runs(reference, other), *_of_tests(reference, other, pairing)):
        part = change.where.partition(": ")[2] or change.where
        differences.setdefault((part, change.path, f"{change.reference}\0{change.other}"), change)
    return tuple(differences.values())


def _of_runs(one: RunReader, other: RunReader) -> Iterator[Change]:
    a, b = one.header, other.header
    for name, was, now in (
        ("protocol", a.protocol_name, b.protocol_name),
        ("title", a.title, b.title),
        ("status", str(one.status), str(other.status)),
        ("operator", a.operator, b.operator),
        ("machine", a.host.get("name", ""), b.host.get("name", "")),
        ("only", ", ".join(a.only), ", ".join(b.only)),
        ("truth", _plants(one), _plants(other)),
    ):
        if was != now:
            yield Change("run", name, was or NONE, now or NONE)
    if a.backend != b.backend or a.source != b.source:
        shown = [f"{h.backend} ({h.source})" if h.source else h.backend for h in (a, b)]
        yield Change("backend", "backend", shown[0] or NONE, shown[1] or NONE)
    yield from _fields("backend", a.backend_options, b.backend_options)
    yield from _fields("versions", dict(a.versions), dict(b.versions))
    yield from _fields("plug-ins", _plug_ins(a.plugins), _plug_ins(b.plugins))


def _of_tests(reference: RunReader, other: RunReader, pairing: Pairing) -> Iterator[Change]:
    trees = [_trees(reference), _trees(other)]
    for pair in pairing.tests:
        one, another = pair.reference, pair.other
        names = one.name if one.name == another.name else f"{one.name} / {another.name}"
        yield from _of_protocol(
            names, pair, trees[0].get(one.name, {}), trees[1].get(another.name, {})
        )
        yield from _benches(f"{names}: bench", one.bench, another.bench)
        plants = reference.header.truth.plants, other.header.truth.plants
        if any(plants):
            yield from _benches(f"{names}: truth", _true(one, plants[0]), _true(another, plants[1]))
    for side, tests in ((0, pairing.only_reference), (1, pairing.only_other)):
        for test in tests:
            words = [NONE, NONE]
            words[side] = test.kind
            yield Change(test.name, "kind", *words)


def _of_protocol(told: str, pair: PairedTest, was: Tree, now: Tree) -> Iterator[Change]:
    """Differences of options (in their units), matrix, repeats, order, seed, stages, bench."""
    for path, one, other in _differing(pair.reference.options, pair.other.options):
        quantity = option_quantity(pair.reference, path) or option_quantity(pair.other, path)
        yield Change(told, path, plain(one, quantity), plain(other, quantity))
    keys = ("matrix", "repeat", "order", "seed", "stages")
    yield from _fields(
        told, {k: was[k] for k in keys if was.get(k)}, {k: now[k] for k in keys if now.get(k)}
    )
    if was.get("bench") != now.get("bench"):
        yield Change(told, "bench", str(was.get("bench") or NONE), str(now.get("bench") or NONE))


def _trees(run: RunReader) -> dict[str, Tree]:
    return {str(test.get("name")): test for test in run.header.tests}


def _benches(where: str, one: Bench | None, other: Bench | None) -> Iterator[Change]:
    if one is None or other is None:
        if one is not other:
            yield Change(
                where, "", "known" if one else "not known", "known" if other else "not known"
            )
        return

    def told(path: str, name: str, was: Any, now: Any) -> Change:
        field = number_at(one, path) or number_at(other, path)
        quantity = None if field is None else field[1]
        return Change(where, name, plain(was, quantity), plain(now, quantity))

    a, b = (bench.model_dump(mode="json", exclude=set(NOT_MOVING)) for bench in (one, other))
    yield from (told(path, path, was, now) for path, was, now in _differing(a, b))
    was, now = one.known.values, other.known.values
    for path in dict.fromkeys((*was, *now)):
        sizes = [own[path].standard_deviation if path in own else None for own in (was, now)]
        if sizes[0] != sizes[1]:
            yield told(path, f"known.values.{path} (1σ)", *sizes)


def _true(test: AnalysedTest, plants: Mapping[str, Tree]) -> Bench | None:
    """Simulated bench of a test; None if the archive does not have it."""
    if test.bench is None:
        return None
    first = test.trials[0].trial.truth if test.trials else ""
    try:
        return simulated(plants[first], test.bench) if first else test.bench
    except (LookupError, ValueError):
        return None


def _plants(run: RunReader) -> str:
    return ", ".join(
        dict.fromkeys(str(p.get("name", "")) for p in run.header.truth.plants.values())
    )


def _plug_ins(plugins: Iterable[Tree]) -> dict[str, Any]:
    return {
        f"{p.get('room')} {p.get('name')}": f"{p.get('distribution')} {p.get('version')}"
        for p in plugins
    }


def _fields(where: str, one: Mapping[str, Any], other: Mapping[str, Any]) -> Iterator[Change]:
    for path, was, now in _differing(one, other):
        yield Change(where, path, plain(was), plain(now))


def _differing(
    one: Mapping[str, Any], other: Mapping[str, Any], above: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Dotted path and both values of each difference; None for a missing value."""
    for key in dict.fromkeys((*one, *other)):
        was, now = one.get(key), other.get(key)
        path = f"{above}{key}"
        if isinstance(was, Mapping) or isinstance(now, Mapping):
            both = [each if isinstance(each, Mapping) else {} for each in (was, now)]
            yield from _differing(both[0], both[1], f"{path}.")
        elif canonical_json(was) != canonical_json(now):
            yield path, was, now
