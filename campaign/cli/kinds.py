"""`campaign kinds`: kinds of protocols and benches, each option with unit and meaning."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from pydantic import BaseModel

from campaign.backends import backends
from campaign.channels import UNITS, VOCABULARY, AxisKind
from campaign.cli.output import on_a_terminal, print_line, print_section, print_table, print_warning
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment
from campaign.export import exports
from campaign.identify import experiments_by_model
from campaign.options import OptionInfo, describe
from campaign.physics.bench import Bench
from campaign.physics.compensation import compensation_methods
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionModel
from campaign.physics.specimens import specimens
from campaign.plugins import Kinds, stray_entries
from campaign.protocol.stages import FIRST
from campaign.report.formats import formats
from campaign.text import nearest
from campaign.unit_grammar import listed
from campaign.units import convert

CHANNELS = ("recording", "channels", "channels of analyses, with unit and meaning")
MODEL = "model of identify"
UNITS_KIND = ("values", "units", "units of values, with their prefixes")
MANY = 20
"""Least options of a table that is listed once only."""
MOST = 60
"""Most options of a kind that a terminal shows at once."""
BENCH = ("bench", "bench", "contents of a bench file", Bench)


def list_kinds() -> None:
    """Print one line per kind, and the problems of installed packages with kinds."""
    rows: list[tuple[str, str, str]] = []
    problems: list[str] = []
    for room in rooms():
        for name, kind in room.described():
            if isinstance(kind, str):
                problems.append(kind)
            else:
                rows.append((room.room, name, f"{kind.summary}{_whose(room, name)}"))
    rows += [(MODEL, name, kind.model.summary) for name, kind in experiments_by_model().items()]
    print_table(("room", "name", "description"), [*rows, BENCH[:3], CHANNELS, UNITS_KIND])
    for problem in (*problems, *stray_entries()):
        print_warning(problem)


def show_kind(name: str) -> None:
    """Print all kinds of that name with their options.

    Raises UsageError for an unknown name or a broken package.
    """
    if name == CHANNELS[1]:
        _show_channels()
        return
    if name == UNITS_KIND[1]:
        _show_units()
        return
    bench, _, table = name.partition(".")
    if bench == BENCH[1] and (not table or table in BENCH[3].model_fields):
        _show(*BENCH, within=table)
        return
    named = [room for room in rooms() if name in room]
    models = {} if named else experiments_by_model()
    if not named and name not in models:
        hint = nearest(name, kind_names()) or "; `campaign kinds` lists them"
        raise UsageError(f"there is no kind {name!r}{hint}")
    for room in named:
        kind = room[name]
        options = getattr(kind, "options", None)  # an export format has none
        _show(room.room, name, f"{kind.summary}{_whose(room, name)}", options)
        if isinstance(kind, FrictionModel) and kind.no_compensation:
            print_line()
            print_line(f"It cannot compensate: {kind.no_compensation}.")
        if isinstance(kind, Experiment):
            if kind.fit is not None:
                print_line()
                print_line(
                    "If a default does not suit the bench, an omitted value follows from the "
                    "bench: `campaign plan` shows the value and the reason."
                )
            _show_needs(kind)
            if kind.model.name == name and kind.model.options is not kind.options:
                _show(MODEL, name, kind.model.summary, kind.model.options)
    if name in models:
        own = models[name]
        _show(MODEL, name, f"{own.model.summary} (by {own.name})", own.model.options)


def kind_names() -> list[str]:
    """Names for `show_kind`, sorted."""
    own = (CHANNELS[1], UNITS_KIND[1], BENCH[1])
    return sorted({*own, *experiments_by_model(), *(name for room in rooms() for name in room)})


def _show(
    room: str, name: str, summary: str, options: type[BaseModel] | None = None, within: str = ""
) -> None:
    print_line(f"{name} ({room}): {summary}")
    if options is not None:
        print_line()
        infos = list(_each_once(tuple(describe(options))))
        if within:
            infos = [i for i in infos if i.name == within or i.name.startswith(f"{within}.")]
        elif len(infos) > MOST and on_a_terminal():
            print_line(
                f"{len(infos)} options; `campaign kinds {name}.TABLE` shows the options of a table."
            )
            infos = [info for info in infos if "." not in info.name]
        rows = [_row(info) for info in infos]
        print_table(("option", "unit or values", "default", "meaning"), rows)


def _each_once(infos: Sequence[OptionInfo]) -> Iterator[OptionInfo]:
    """Options without repeats: equal ones of several alternatives, and equal tables, once each."""
    tables: dict[str, str] = {}
    alike: dict[str, list[OptionInfo]] = {}
    within = "."
    for info in infos:
        if info.name.startswith(within):
            continue
        end = len(info.name)
        below = [
            repr(replace(each, name=each.name[end:], when=""))
            for each in infos
            if each.name.startswith(f"{info.name}.")
        ]
        if len(below) >= MANY:
            first = tables.setdefault("".join(below), info.name)
            if first != info.name:
                within = f"{info.name}."
                info = replace(info, meaning=f"{info.meaning} Same options as {first}.")
        alike.setdefault(repr(replace(info, when="")), []).append(info)
    for info, *others in alike.values():
        # "method = a, model = b" and "method = a, model = c" differ in the last word.
        start = info.when.rpartition(" = ")[0]
        words = [info.when, *(other.when.removeprefix(f"{start} = ") for other in others)]
        yield replace(info, when=" | ".join(words))


def _show_needs(experiment: Experiment) -> None:
    """Print the channels that an experiment's analysis reads, and its possible stages."""
    required, optional = experiment.requires.items(), experiment.can_use.items()
    rows = [(name, "required", f"for {what}") for name, what in required]
    rows += [(name, "optional", f"without it: no {what}") for name, what in optional]
    print_section(("channel", "", "purpose"), rows)
    stages = [(f"{n}, {stage.name}", stage.why) for n, stage in enumerate(experiment.stages, FIRST)]
    print_section(("stage", "reason"), stages)


def _show_channels() -> None:
    """Print the vocabulary of channels."""
    _show(*CHANNELS)
    rows = []
    for name, what in VOCABULARY.items():
        units = [UNITS[axis][what.quantity][0] or what.quantity.value for axis in AxisKind]
        rows.append((name, *units, what.side.value, what.known_by.value, what.meaning))
    print_section(("channel", "unit", "linear axis", "side", "known by", "meaning"), rows)


def rooms() -> Iterator[Kinds[Any]]:
    """Rooms of all kinds that packages may provide."""
    yield from (experiments(), friction_models(), specimens(), compensation_methods(), backends())
    yield from (exports(), formats())


def _whose(room: Kinds[Any], name: str) -> str:
    """Text on the installed package of a kind; "" for the program's own."""
    plug_in = room.plug_in(name)
    return f" (of {plug_in.distribution} {plug_in.version})" if plug_in is not None else ""


def _show_units() -> None:
    """Print the table of units; docs/protocols.md has the grammar of compound units."""
    _show(*UNITS_KIND)
    rows = [(name, " ".join(prefixes), "  ".join(others)) for name, prefixes, others in listed()]
    print_section(("unit", "prefixes", "or"), rows)


def _row(info: OptionInfo) -> tuple[str, str, str, str]:
    takes = " | ".join(filter(None, (info.unit, info.accepts)))
    meaning = f"With {info.when}: {info.meaning}" if info.when else info.meaning
    return info.name, takes, "required" if info.required else _default(info), meaning


def _default(info: OptionInfo) -> str:
    if info.default is None or info.default == "":
        return ""
    if info.quantity is not None:
        return _quantities(info.default, info.quantity.si, info.quantity.display)
    if isinstance(info.default, bool):
        return "true" if info.default else "false"
    if isinstance(info.default, tuple | list | dict) and not info.default:
        return "none"
    if isinstance(info.default, tuple | list):
        return ", ".join(str(item) for item in info.default)
    if isinstance(info.default, dict):
        return f"{{ {', '.join(f'{key} = {value}' for key, value in info.default.items())} }}"
    return f'"{info.default}"' if isinstance(info.default, str) else f"{info.default}"


def _quantities(value: Any, si: str, display: str) -> str:
    """Text of a value (SI) or a list of values: `20 s`, `0.05 deg/s, 65 deg/s`."""
    if isinstance(value, tuple | list):
        return ", ".join(_quantities(item, si, display) for item in value)
    return f"{convert(value, si, display):.6g} {display}"
