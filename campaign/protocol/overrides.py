"""`--set dotted.path=value` on the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from campaign.errors import Problem
from campaign.protocol.files import Typed
from campaign.protocol.positions import Keys

EXAMPLE = 'write --set test.option=value, such as --set stabilization.frequency="0.5 Hz"'


@dataclass(frozen=True)
class Override:
    """One `--set`: path, and the value as TOML would give it."""

    text: str
    keys: Keys
    value: Any

    @property
    def origin(self) -> Typed:
        return Typed(f"--set {self.text}")


def parse_overrides(texts: Sequence[str]) -> tuple[list[Override], list[Problem]]:
    """The valid overrides, and the problems of the others."""
    overrides, problems = [], []
    for text in texts:
        path, equals, value = text.partition("=")
        keys = _keys(path)
        if not equals or not keys:
            wrong = Typed(f"--set {text}")
            problems.append(wrong.problem((), "value", f"not a setting; {EXAMPLE}"))
        else:
            overrides.append(Override(text, keys, _value(value.strip())))
    return overrides, problems


def _keys(path: str) -> Keys:
    """The parts of a dotted key, including quoted ones; empty for other text."""
    try:
        tree: Any = tomllib.loads(f"{path.strip()} = 0")
    except (ValueError, RecursionError):
        return ()
    keys: Keys = ()
    while isinstance(tree, dict):
        if len(tree) != 1:
            return ()
        key, tree = next(iter(tree.items()))
        keys = (*keys, key)
    return keys


def _value(text: str) -> Any:
    """The value of valid TOML, else the text: quotes are optional."""
    try:
        tree = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tree["value"] if tree.keys() == {"value"} else text
