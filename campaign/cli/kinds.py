"""`campaign kinds`: what protocols and benches can name, each option with unit and meaning."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from typing import Any

from campaign.backends import backends
from campaign.channels import UNITS, VOCABULARY, AxisKind
from campaign.cli.output import print_line, print_table
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment
from campaign.options import OptionInfo, describe
from campaign.physics.bench import Bench
from campaign.physics.compensation import compensation_methods
from campaign.physics.friction import friction_models
from campaign.unit_grammar import listed
from campaign.units import convert

EXPERIMENT = "experiment"
CHANNELS = ("recording", "channels", "the channels that analyses know, with unit and meaning")
UNITS_KIND = ("values", "units", "the units that values are written in, with their prefixes")
BENCH = ("bench", "bench", "what a bench file may contain", Bench)


def list_kinds() -> None:
    """One line per kind."""
    rows = [*(kind[:3] for kind in _all_kinds()), CHANNELS, UNITS_KIND]
    print_table(("room", "name", "what it is"), rows)


def show_kind(name: str) -> None:
    """Every kind of that name with its options. Raises UsageError when there is none."""
    if name == CHANNELS[1]:
        _show_channels()
        return
    if name == UNITS_KIND[1]:
        _show_units()
        return
    kinds = list(_all_kinds())
    chosen = [kind for kind in kinds if kind[1] == name]
    if not chosen:
        names = {CHANNELS[1], UNITS_KIND[1], *(kind[1] for kind in kinds)}
        close = difflib.get_close_matches(name, sorted(names), n=1)
        hint = f"did you mean {close[0]!r}?" if close else "`campaign kinds` lists them"
        raise UsageError(f"there is no kind {name!r}; {hint}")
    for room, kind, summary, options in chosen:
        print_line(f"{kind} ({room}): {summary}")
        print_line()
        rows = [_row(info) for info in describe(options)]
        print_table(("option", "unit or values", "default", "meaning"), rows)
        if room == EXPERIMENT:
            _show_needs(experiments()[kind])


def _show_needs(experiment: Experiment) -> None:
    """The channels that its analysis reads."""
    required, optional = experiment.requires.items(), experiment.can_use.items()
    rows = [(name, "required", f"for {what}") for name, what in required]
    rows += [(name, "optional", f"without it: no {what}") for name, what in optional]
    if rows:
        print_line()
        print_table(("channel", "", "what it is for"), rows)


def _show_channels() -> None:
    """The vocabulary."""
    print_line(f"{CHANNELS[1]} ({CHANNELS[0]}): {CHANNELS[2]}")
    print_line()
    rows = []
    for name, what in VOCABULARY.items():
        units = [UNITS[axis][what.quantity][0] or what.quantity.value for axis in AxisKind]
        rows.append((name, *units, what.side.value, what.known_by.value, what.meaning))
    print_table(("channel", "unit", "linear axis", "side", "known by", "meaning"), rows)


def _show_units() -> None:
    """The table of units; docs/protocols.md has the grammar of what is made of them."""
    print_line(f"{UNITS_KIND[1]} ({UNITS_KIND[0]}): {UNITS_KIND[2]}")
    print_line()
    rows = [(name, " ".join(prefixes), "  ".join(others)) for name, prefixes, others in listed()]
    print_table(("unit", "prefixes", "or"), rows)


def _all_kinds() -> Iterator[tuple[str, str, str, Any]]:
    rooms: Sequence[tuple[str, dict[str, Any]]] = (
        (EXPERIMENT, experiments()),
        ("friction model", friction_models()),
        ("compensation method", compensation_methods()),
        ("backend", backends()),
    )
    for room, kinds in rooms:
        for name, kind in kinds.items():
            yield room, name, kind.summary, kind.options
    yield BENCH


def _row(info: OptionInfo) -> tuple[str, str, str, str]:
    takes = " | ".join(filter(None, (info.unit, info.accepts)))
    return info.name, takes, "required" if info.required else _default(info), info.meaning


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
    """`value` or a list of values as a reader writes it: `20 s`, `0.05 deg/s, 65 deg/s`."""
    if isinstance(value, tuple | list):
        return ", ".join(_quantities(item, si, display) for item in value)
    return f"{convert(value, si, display):.6g} {display}"
