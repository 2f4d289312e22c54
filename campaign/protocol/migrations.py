"""From an older schema to the present one: what protocols and benches spelled otherwise before.

Each migration takes a document (nested tables, of `tomllib` or of an editor that keeps comments)
and rewrites it in place, from one schema to the next. It returns what it did; what only a person
can decide it leaves as it is and says so. Loading accepts the former spellings of a bench as well.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

from campaign.physics.known import FORMER as FORMER_KNOWN
from campaign.physics.preload import FORMER as FORMER_PRELOAD
from campaign.physics.scatter import CLASSIC
from campaign.physics.scatter import FORMER as FORMER_VARIATION
from campaign.protocol.files import MARKS, Kind

Document = MutableMapping[str, Any]


@dataclass(frozen=True)
class Change:
    """What was done at a place of a document, or what a person has to do there."""

    place: str
    what: str
    by_hand: bool = False


Migration = Callable[[Document], Iterator[Change]]
"""Consumed to its end, it has rewritten the document."""


def kind_of(document: Mapping[str, Any]) -> Kind:
    """A bench has an axis, a motor or limits; a protocol has none of them."""
    return "bench" if document.keys() & MARKS["bench"] else "protocol"


def migrate(document: Document, kind: Kind) -> list[Change]:
    """Bring `document` forward from the schema it names, the first when it names none."""
    begin = document.get("schema", 1)
    changes: list[Change] = []
    for migration in MIGRATIONS[kind][begin - 1 :]:
        changes += migration(document)
    return changes


def _bench_by_path(bench: Document) -> Iterator[Change]:
    """1 to 2: scatter and preload name friction parameters by their path."""
    if isinstance(variation := bench.get("variation"), MutableMapping):
        yield from _scatter(variation)
    gear = bench.get("gear")
    preload = gear.get("preload") if isinstance(gear, Mapping) else None
    if isinstance(preload, MutableMapping):
        yield from _shares(preload)


def _scatter(variation: Document) -> Iterator[Change]:
    for old, (table, name) in FORMER_VARIATION.items():
        if old not in variation:
            continue
        place, now = f"variation.{old}", f"variation.{table}.{name}"
        lines = variation.get(str(table), {})
        if not isinstance(lines, MutableMapping) or name in lines:
            yield Change(place, f"is given as {now}, too; remove one of them", by_hand=True)
            continue
        value = variation.pop(old)
        if value == 0:
            yield Change(place, "removed: zero is no scatter")
            continue
        joint = {"paths": list(CLASSIC[:2]), "relative": value}
        if not lines:
            variation[str(table)] = {}
        variation[str(table)][str(name)] = joint if old == "trial" else value
        yield Change(place, f"is {now} now")


def _shares(preload: Document) -> Iterator[Change]:
    former = [name for name in FORMER_PRELOAD if name in preload]
    if former and "shares" in preload:
        for name in former:
            what = "is given beside gear.preload.shares; remove one of them"
            yield Change(f"gear.preload.{name}", what, by_hand=True)
        return
    given = {"static_share": 1.0, **{name: preload[name] for name in former}}
    shares = {str(FORMER_PRELOAD[name][1]): value for name, value in given.items() if value != 0}
    for name in former:
        del preload[name]
        now = ".".join(map(str, FORMER_PRELOAD[name]))
        kept = f"is gear.preload.{now} now" if given[name] else "removed: zero is no share"
        yield Change(f"gear.preload.{name}", kept)
    if former:
        preload["shares"] = shares


def _bench_known(bench: Document) -> Iterator[Change]:
    """2 to 3: the published cells that a bench was made from stand under `known`."""
    for name in FORMER_KNOWN:
        if name not in bench:
            continue
        there = bench.get("known", {})
        if not isinstance(there, MutableMapping) or name in there:
            what = f"is given as known.{name}, too; remove one of them"
            yield Change(name, what, by_hand=True)
            continue
        cells = bench.pop(name)
        if "known" not in bench:
            bench["known"] = {}
        bench["known"][name] = cells
        yield Change(name, f"is known.{name} now; `campaign fingerprint` states of which bench")


def _paths(table: str, former: Mapping[str, Sequence[Any]]) -> dict[str, str]:
    """Former paths of the bench in that table, and the present ones."""
    return {f"{table}.{old}": ".".join((table, *map(str, now))) for old, now in former.items()}


_OLD_TRIAL = "bench.variation.trial"
_PATHS = _paths("bench.variation", FORMER_VARIATION) | _paths("bench.gear.preload", FORMER_PRELOAD)
del _PATHS[_OLD_TRIAL]  # one number then, a table now
_JOINT = "bench.variation.trial_to_trial.torques.relative"


def _protocol_by_path(protocol: Document) -> Iterator[Change]:
    """1 to 2: what is swept and what an operator sets follow the paths of the bench."""
    tests = protocol.get("test", [])
    for test in tests if isinstance(tests, list) else []:
        if not isinstance(test, MutableMapping):
            continue
        here = f"test '{test.get('name', '?')}'"
        matrix = test.get("matrix")
        if isinstance(matrix, MutableMapping):
            yield from _swept(matrix, f"{here}: matrix")
        steps = test.get("operator", [])
        for step in steps if isinstance(steps, list) else []:
            if isinstance(step, MutableMapping):
                yield from _step(step, f"{here}: operator")


def _swept(matrix: Document, place: str) -> Iterator[Change]:
    given = list(_flat(matrix))
    for path in given:
        if path == _OLD_TRIAL:
            what = f"is a table of the bench now: give it there, and sweep {_JOINT} if it has one"
            yield Change(f"{place}.{path}", what, by_hand=True)
        if path not in _PATHS:
            continue
        if _PATHS[path] in given:
            what = f"is given as {_PATHS[path]}, too; remove one of them"
            yield Change(f"{place}.{path}", what, by_hand=True)
            continue
        if path not in matrix:
            what = f"is {_PATHS[path]} now; written as tables, it is left to you"
            yield Change(f"{place}.{path}", what, by_hand=True)
            continue
        _rename(matrix, path, _PATHS[path])
        yield Change(f"{place}.{path}", f"is {_PATHS[path]} now")


def _step(step: Document, place: str) -> Iterator[Change]:
    given = step.get("sets")
    sets: list[Any] = given if isinstance(given, list) else []
    for index, path in enumerate(sets):
        if path in _PATHS:
            sets[index] = _PATHS[path]
            yield Change(f"{place}.sets", f"{path} is {_PATHS[path]} now")
    text = step.get("text")
    if isinstance(text, str):
        new = re.sub(r"(?<!\{)\{([a-z_.]+)\}", lambda m: f"{{{_PATHS.get(m[1], m[1])}}}", text)
        if new != text:
            step["text"] = new
            yield Change(f"{place}.text", "names the paths of the bench as they are now")


def _rename(table: Document, old: str, new: str) -> None:
    """The same value under another key, in its place: the order of a matrix is a sequence."""
    keys = list(table)
    behind = [(key, table.pop(key)) for key in keys[keys.index(old) :]]
    for key, value in behind:
        table[new if key == old else key] = value


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[str]:
    for key, value in table.items():
        yield before + key
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")


MIGRATIONS: Mapping[Kind, Sequence[Migration]] = {
    "bench": (_bench_by_path, _bench_known),
    "protocol": (_protocol_by_path,),
}
"""By the schema they start from, minus one."""
