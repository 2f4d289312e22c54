"""The bench file with identified values, intervals and origins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from campaign import __version__
from campaign.axis_kind import axis_terms, axis_unit
from campaign.errors import CampaignError
from campaign.identify.compensations import (
    DIRECTIONS,
    amount,
    identified_compensations,
    known_of,
    without_identified,
)
from campaign.identify.identification import Identification, Section
from campaign.parameter import Parameter
from campaign.physics.bench import Bench
from campaign.physics.friction import coulomb, friction_models, stribeck
from campaign.protocol.bench_edit import with_known

LEAST_CORRELATION = 0.1
"""Correlations below this magnitude are not written."""
FRICTION = "friction.load."


def bench_text(found: Identification, command: str) -> str:
    """Bench file with the identified values; comments stay.

    Raises CampaignError if the run lacks the bench file, or the file cannot be edited.
    """
    name, text = _source(found)
    text = without_identified(text)
    values: dict[str, Any] = {}
    known: dict[str, Any] = {}
    correlations: list[list[Any]] = []
    sliding = _of_sliding(found.sections)
    with axis_terms(found.bench.sides):
        for section in found.sections:
            filled = _going(section, sliding)
            for parameter in filled.values():
                estimate = parameter.estimate
                values[parameter.bench] = amount(estimate.value, estimate.unit)
                known[parameter.bench] = known_of(estimate)
            correlations += _correlations(section, filled)
            if filled:
                for path, (value, unit, _) in _settings(section, found.bench).items():
                    if _is_friction(path) and section is not sliding:
                        continue
                    values[path] = value
                    if isinstance(value, float):
                        values[path] = amount(value, axis_unit(unit))
                        known[path] = {"origin": "assumed"}
    compensations = identified_compensations(found, text)
    values |= compensations.values
    known |= compensations.known
    entries: dict[str, Any] = {"identified": _identified(found, command), "values": known}
    stale = _stale(values, found.bench)
    kept = [
        list(each)
        for each in found.bench.known.correlations
        if not {each[0], each[1]} & {*known, *stale}
    ]
    if correlations:
        entries["correlations"] = kept + correlations
    return with_known(_edited(text, values, stale), entries, name)


def keys_by_method(found: Identification) -> dict[str, list[str]]:
    """Keys of the bench file by the method that provides their values."""
    sliding = _of_sliding(found.sections)
    method = {
        parameter.bench: section.model.name
        for section in found.sections
        for parameter in _going(section, sliding).values()
    }  # if several methods provide a key, the last one counts
    return {name: [k for k in method if method[k] == name] for name in method.values()}


def nothing_to_write(found: Identification) -> bool:
    """Whether no parameter has a place in a bench file."""
    filled = any(_filled(section) for section in found.sections)
    return not filled and not identified_compensations(found, _source(found)[1]).values


def _source(found: Identification) -> tuple[str, str]:
    header = found.chosen.run.header
    tests = {str(each.get("name", "")): each for each in header.tests}
    test = found.chosen.trials[0].trial.test
    name = str(tests.get(test, {}).get("bench", ""))
    if name not in header.sources:
        raise CampaignError(f"{found.chosen.run.name}: does not hold the file of its bench")
    return name, header.sources[name]


def _filled(section: Section) -> dict[str, Parameter]:
    """Parameters with a key of the bench file, by name."""
    return {each.estimate.name: each for each in section.identified.parameters if each.bench}


def _going(section: Section, sliding: Section | None) -> dict[str, Parameter]:
    """Parameters of a method for the file, by name; `sliding` alone provides sliding friction."""
    filled = _filled(section)
    if section is not sliding and _tells_sliding(filled):
        # Do not mix numbers of two models in one curve.
        return {n: each for n, each in filled.items() if not _is_friction(each.bench)}
    if section is sliding and not _tells_curve(section):
        return {n: each for n, each in filled.items() if not _bends(each.bench)}
    return filled


def _of_sliding(sections: Sequence[Section]) -> Section | None:
    """Section that provides the sliding friction of the bench file.

    Preferred: one with a Stribeck curve, then one with both directions (a bench has no key for an
    offset), then the last.
    """

    def tells(section: Section) -> tuple[bool, bool]:
        both = _tells_sliding(_filled(section), "negative.coulomb_torque")
        return _tells_curve(section), both

    candidates = [each for each in reversed(sections) if _tells_sliding(_filled(each))]
    return max(candidates, key=tells, default=None)


def _tells_sliding(filled: Mapping[str, Parameter], key: str = "coulomb_torque") -> bool:
    return any(each.bench == f"{FRICTION}{key}" for each in filled.values())


def _is_friction(path: str) -> bool:
    return path.startswith(FRICTION)


def _tells_curve(section: Section) -> bool:
    """Whether the section measures a complete Stribeck curve, without values from settings."""
    settings = section.identified.settings
    left_open = any(path.endswith(("static_torque", "stribeck_velocity")) for path in settings)
    return _tells_sliding(_filled(section), "static_torque") and not left_open


def _settings(section: Section, bench: Bench) -> dict[str, tuple[Any, str, str]]:
    """Settings of a section for the file; they keep bristles of the bench (LuGre).

    Without a measured curve, friction is Coulomb and viscous. If the bench then has bristles, its
    model and the rest of its curve stay.
    """
    settings = dict(section.identified.settings)
    model, load = f"{FRICTION}model", bench.friction.get("load")
    if model not in settings:
        return settings
    bristles = load is not None and load.model == "lugre"
    if not _tells_curve(section):
        settings = {path: each for path, each in settings.items() if not _bends(path)}
        settings[model] = ("coulomb", "", "nothing else of the curve is determined")
        if bristles:
            del settings[model]
    elif bristles and settings[model][0] == "stribeck":
        settings[model] = ("lugre", *settings[model][1:])
    return settings


def _bends(path: str) -> bool:
    """Whether a key of friction is unknown to Coulomb and viscous friction."""
    return _is_friction(path) and path.rpartition(".")[2] not in {"model", *coulomb.CURVE}


def _stale(values: Mapping[str, Any], bench: Bench) -> list[str]:
    """Keys of the bench's friction that the new curve does not set or the model does not know."""
    load, model = bench.friction.get("load"), values.get(f"{FRICTION}model")
    if load is None or model is None:
        return []
    # A new curve replaces all keys of the old one.
    curve = [f"{FRICTION}{side}{key}" for side in DIRECTIONS for key in stribeck.CURVE]
    known = friction_models()[model].options.model_fields
    unknown = [f"{FRICTION}{key}" for key in type(load).model_fields if key not in known]
    return [path for path in (*curve, *unknown) if path not in values]


def _without(document: Any, path: str) -> None:
    """Remove a key from a bench file, and its entry in `known.values`."""
    *tables, key = path.split(".")
    table = document
    for name in tables:
        table = table.get(name, {})
    if key in table:
        del table[key]
    of_values = document.get("known", {}).get("values", {})
    if path in of_values:
        del of_values[path]


def _correlations(section: Section, filled: Mapping[str, Parameter]) -> Iterator[list[Any]]:
    for (one, other), share in section.identified.correlations.items():
        if one in filled and other in filled and abs(share) >= LEAST_CORRELATION:
            yield [filled[one].bench, filled[other].bench, round(max(-1.0, min(1.0, share)), 3)]


def _identified(found: Identification, command: str) -> dict[str, str]:
    return {
        "run": found.chosen.name,
        "digest": found.chosen.run.identity,
        "program": f"campaign {__version__}",
        "command": command,
    }


def _edited(text: str, values: Mapping[str, Any], stale: Sequence[str]) -> str:
    """Text with each value at its key, in a new table if needed; without the `stale` keys."""
    import tomlkit

    newline = "\r\n" if "\r\n" in text else "\n"
    document = tomlkit.parse(text.replace("\r\n", "\n"))
    for path in stale:
        _without(document, path)
    for path, value in values.items():
        *tables, key = path.split(".")
        table: Any = document
        for depth, name in enumerate(tables):
            if name not in table:
                inline = isinstance(table, tomlkit.items.InlineTable)  # as of `friction = {}`
                outer = depth + 1 < len(tables)
                table[name] = tomlkit.inline_table() if inline else tomlkit.table(outer)
            table = table[name]
        table[key] = value
    return document.as_string().replace("\n", newline)
