"""Which cells a pattern means."""

from __future__ import annotations

import pytest

from campaign.published.patterns import covers, overlap


@pytest.mark.parametrize(
    ("pattern", "path", "does"),
    [
        ("5.11", "5.11/0.4/lugre", True), ("5.11/0.4", "5.11/0.4/lugre", True),
        ("5.11/*/lugre", "5.11/0.4/lugre", True), ("*/*/lugre", "5.11/0.4/lugre", True),
        ("*", "5.11/0.4/lugre", True), ("5.1", "5.11/0.4/lugre", False),
        ("5.11/0", "5.11/0.4/lugre", False), ("5.11/*/none", "5.11/0.4/lugre", False),
        ("5.11/0.4/lugre/*", "5.11/0.4/lugre", False), ("", "5.11/0.4/lugre", False),
        ("33/*", "33/none", True), ("*/none", "33/static", False),
    ],
)  # fmt: skip
def test_covers(pattern: str, path: str, does: bool) -> None:
    assert covers(pattern, path) is does


@pytest.mark.parametrize(
    ("one", "other", "do"),
    [
        ("5.11/0.2", "5.11", True), ("5.11", "5.11/0.2", True), ("5.12/33", "5.12/50", False),
        ("5.12/*/lugre", "5.12/50", True), ("*/0.2", "5.11", True), ("5.1", "5.10", False),
    ],
)  # fmt: skip
def test_overlap(one: str, other: str, do: bool) -> None:
    assert overlap(one, other) is overlap(other, one) is do
