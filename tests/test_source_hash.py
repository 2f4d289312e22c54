"""The hash of a package's sources: what changes it, and what does not."""

from __future__ import annotations

import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from campaign.source_hash import digest, sources_of

FILES = {
    "hashed_one/__init__.py": "from hashed_two import f\nimport numpy\n",
    "hashed_one/deep/part.py": "x = 1\n",
    "hashed_one/template.txt": "text",
    "hashed_two.py": "import hashed_three.inner as inner\nf = 2\n",
    "hashed_three/inner.py": "",  # a namespace package
    "hashed_four.py": "",
    "site-packages/hashed_five.py": "",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(sys, "path", [str(tmp_path), str(tmp_path / "site-packages"), *sys.path])
    return tmp_path


def edited(path: Path, text: str) -> str:
    path.write_text(text, encoding="utf-8")
    return digest(sources_of(["hashed_one"]))


def test_the_package_and_what_it_imports_from_folders_on_the_path(folder: Path) -> None:
    assert list(sources_of(["hashed_one"])) == [
        "hashed_one/__init__.py",
        "hashed_one/deep/part.py",
        "hashed_three/inner.py",
        "hashed_two.py",
    ]
    assert not [name for name in sys.modules if name.startswith("hashed")]  # nothing is imported


@pytest.mark.parametrize(
    "before",
    [
        *("def f():", "class A:", "if 0: f\nelse:", "try: f\nexcept E:", "try: f\nfinally:"),
        *("with f:", "for x in f:", "while f: f\nelse:", "match f:\n case 1:", "async def f():"),
    ],
)
def test_an_import_counts_in_every_block(folder: Path, before: str) -> None:
    (folder / "hashed_one/deep/part.py").write_text(f"{before}\n  import hashed_four")
    assert "hashed_four.py" in sources_of(["hashed_one"])


def test_every_edit_of_a_source_changes_it(folder: Path) -> None:
    before = digest(sources_of(["hashed_one"]))
    seen = {before}
    for name in ("hashed_one/deep/part.py", "hashed_two.py", "hashed_three/inner.py"):
        now = edited(folder / name, FILES[name] + "# edited\n")
        assert now not in seen, name
        seen.add(now)
        assert edited(folder / name, FILES[name]) == before
    assert (
        edited(folder / "hashed_one" / f"fast{EXTENSION_SUFFIXES[0]}", "machine code") not in seen
    )


def test_what_is_no_source_of_it_changes_nothing(folder: Path) -> None:
    before = digest(sources_of(["hashed_one"]))
    assert edited(folder / "hashed_one/template.txt", "other") == before
    assert edited(folder / "hashed_four.py", "other = 1") == before


def test_an_installed_library_is_looked_into_when_it_is_the_package_itself(folder: Path) -> None:
    (folder / "hashed_four.py").write_text("import hashed_five\nimport campaign\nimport os\n")
    assert list(sources_of(["hashed_four"])) == ["hashed_four.py"]
    assert list(sources_of(["hashed_five"])) == ["hashed_five.py"]


def test_what_cannot_be_found_or_parsed_has_no_imports(folder: Path) -> None:
    assert sources_of(["hashed_nowhere", "sys"]) == {}
    (folder / "hashed_four.py").write_text("import hashed_two\ndef (\n")
    assert list(sources_of(["hashed_four"])) == ["hashed_four.py"]


def test_where_the_folder_lies_does_not_matter(folder: Path, tmp_path: Path) -> None:
    before = digest(sources_of(["hashed_one"]))
    elsewhere = tmp_path / "elsewhere"
    sources = {name: elsewhere / name for name in sources_of(["hashed_one"])}
    for name, path in sources.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(FILES[name], encoding="utf-8")
    assert digest(sources) == before
