"""Lines of a part of a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.archive.layout.files import lines_of


@pytest.mark.parametrize(
    ("content", "size", "lines"),
    [
        (b"-one\ntwo\n", 8, [b"one", b"two"]),
        (b"-one\ntwo\nthree\n", 8, [b"one", b"two"]),
        (b"-one\ntwo\nthree\n", 10, [b"one", b"two"]),
        (b"-one\ntwoX", 8, [b"one"]),
        (b"-one\r\n\n", 6, [b"one\r", b""]),
    ],
)
def test_lines_of_a_part_are_its_complete_ones(
    tmp_path: Path, content: bytes, size: int, lines: list[bytes]
) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    assert list(lines_of(path, 1, size)) == lines
