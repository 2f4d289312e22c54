"""What `make mutants` reads is there, and docs/developers/testing.md names what it excuses."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ATTACKED: dict[str, list[str]] = tomllib.loads((HERE / "attacked.toml").read_text("utf-8"))
ELSEWHERE = ATTACKED.pop("rooms")
EQUIVALENTS: list[dict[str, str]] = tomllib.loads((HERE / "equivalents.toml").read_text("utf-8"))[
    "mutant"
]


@pytest.mark.parametrize("file", ATTACKED)
def test_what_is_attacked_and_its_tests_are_there(file: str) -> None:
    for path in (file, *ATTACKED[file]):
        assert (ROOT / path).is_file()


def test_every_equivalent_is_named_with_its_reason() -> None:
    document = (ROOT / "docs" / "developers" / "testing.md").read_text("utf-8")
    for one in EQUIVALENTS:
        assert one["file"] in ATTACKED
        place = f"`{one['file']}`, `{one['function']}`"
        assert f"- {place}: `{one['was']}` → `{one['now']}`. {one['why']}\n" in document
