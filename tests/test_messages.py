"""What a user reads: short sentences, reasons with codes and named values, terms of the axis.

Texts are those of the source; f-strings have `{}` for each value.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from string import Formatter

import pytest

from campaign.axis_kind import AxisKind, Sides, in_axis_terms
from campaign.unit_grammar import parse_unit

CAMPAIGN = Path(__file__).parents[1] / "campaign"
ROOMS = sorted(each.name for each in CAMPAIGN.iterdir() if (each / "__init__.py").is_file())
NOUNS = ""
"""Of files that are in no room."""

LONGEST = 25
"""words of a sentence."""
OTHER_LANGUAGES = ("@media", r"\usepackage")

ROTARY_ROOMS = ("canopen_drive", "controller_code", "importing", "device", "wire", "cli")
"""About a drive that turns, code in SI, or columns whose axis is not known yet."""
ROTARY_FILES = ("backends/canopen.py", "axis_kind.py", "units.py", "unit_grammar.py")
SAYS_WHICH = re.compile(r"rotary|motor|gear\.lead|A s/deg|^rpm|^{} deg$")
"""A text that says of which kind of axis or side it is, or that is of a phase or a bench file."""
ROTARY = re.compile(
    r"(?<![\w.'`\"\[])(?:torques?|inertias?|angles?|angular|revolutions?|(?<!in )turn(?:s|ed|ing)?"
    r"|rad|mrad|(?<!180 )(?<!20 )deg|N[ ·]m|kg[ ·]m)(?![\w`\"\]=]|\.\w|'(?!s))",
    re.IGNORECASE,
)
"""Words and units of a rotary axis, but no option; 180 and 20 deg are phases."""
LINEAR = Sides(AxisKind.LINEAR, AxisKind.LINEAR)


@cache
def trees(room: str) -> dict[str, ast.Module]:
    """The files of a room, by path."""
    paths = (CAMPAIGN / room).rglob("*.py") if room else CAMPAIGN.glob("*.py")
    return {
        path.relative_to(CAMPAIGN).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(paths)
        if "package_templates" not in path.parts
    }


def text_of(node: ast.AST) -> str | None:
    """The text of a literal, also of one that is put together by `+`; None of anything else."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr():
            return "".join(text_of(part) or "{}" for part in node.values)
        case ast.BinOp(op=ast.Add()):
            one, other = text_of(node.left), text_of(node.right)
            return None if one is None and other is None else f"{one or '{}'}{other or '{}'}"
    return None


def texts_in(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of the literals of a file; of docstrings only those of options."""
    left_out: set[int] = set()  # parts of texts, and docstrings
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef):
            own = node.body[:1] if isinstance(node, ast.ClassDef) else node.body
            left_out |= {id(each.value) for each in own if isinstance(each, ast.Expr)}
        elif isinstance(node, ast.expr) and id(node) not in left_out:
            text = text_of(node)
            if text is not None:
                left_out |= {id(each) for each in ast.iter_child_nodes(node)}
                yield node.lineno, " ".join(text.split())


@cache
def texts(room: str) -> tuple[tuple[str, str, str], ...]:
    """File, place and text of all that may be a sentence."""
    return tuple(
        (file, f"{file}:{line}", text)
        for file, tree in trees(room).items()
        for line, text in texts_in(tree)
        if " " in text and not _is_unit(text)
    )


def _is_unit(text: str) -> bool:
    try:
        parse_unit(text)
    except ValueError:
        return False
    return True


def sentences(text: str) -> list[str]:
    return re.split(r"(?<=[.;?!])\s+", re.sub(r"`[^`]*`", "`name`", text))


@pytest.mark.parametrize("room", [NOUNS, *ROOMS])
def test_a_sentence_has_at_most_25_words(room: str) -> None:
    long = [
        f"{place}: {sentence}"
        for _, place, text in texts(room)
        for sentence in sentences(text)
        if len(re.findall(r"\S*[\w{]\S*", sentence)) > LONGEST
        and not any(each in text for each in OTHER_LANGUAGES)
    ]
    assert long == []


@pytest.mark.parametrize("room", [each for each in (NOUNS, *ROOMS) if each not in ROTARY_ROOMS])
def test_the_table_of_terms_makes_each_text_true_of_a_linear_axis(room: str) -> None:
    wrong = [
        f"{place}: {found[0]!r} in {text}"
        for file, place, text in texts(room)
        if file not in ROTARY_FILES and not SAYS_WHICH.search(text)
        if (found := ROTARY.search(in_axis_terms(text, LINEAR)))
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "text",
    [
        "until it turns",
        "12 periods per revolution",
        "at {} N·m",
        "largest angular rate",
        "{} deg/s",
    ],
)
def test_a_text_of_a_rotary_axis_alone_is_seen(text: str) -> None:
    assert ROTARY.search(in_axis_terms(text, LINEAR))


@pytest.mark.parametrize(
    "text", ["the torque", "An angle", "Inertias", "raise limits.torque", "the option `angle`"]
)
def test_terms_and_names_of_options_are_right_of_both(text: str) -> None:
    assert not ROTARY.search(in_axis_terms(text, LINEAR))


# Reasons ------------------------------------------------------------------------------------------


@cache
def causes() -> dict[tuple[str, str], ast.Call]:
    """Those that are declared, by module and name."""
    return {
        (file.removesuffix(".py"), target.id): node.value
        for room in (NOUNS, *ROOMS)
        for file, tree in trees(room).items()
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
        if isinstance(node.value, ast.Call) and getattr(node.value.func, "id", "") == "Cause"
    }


def _called(file: str, tree: ast.Module) -> Iterator[tuple[ast.Call, ast.Call]]:
    """Calls of reasons in a file, each with its declaration."""
    known = {name: call for (module, name), call in causes().items() if file == f"{module}.py"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = node.module.removeprefix("campaign.").replace(".", "/")
            for each in node.names:
                if (module, each.name) in causes():
                    known[each.asname or each.name] = causes()[module, each.name]
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            yield node, known[node.func.id]


@pytest.mark.slow
def test_each_reason_has_a_code_of_its_own() -> None:
    codes = Counter(ast.literal_eval(call.args[0]) for call in causes().values())
    assert len(codes) > 200
    assert [code for code, count in codes.items() if count > 1] == []


@pytest.mark.slow
def test_a_reason_gets_all_values_of_its_text() -> None:
    seen, wrong = 0, []
    for room in (NOUNS, *ROOMS):
        for file, tree in trees(room).items():
            for call, cause in _called(file, tree):
                text = text_of(cause.args[1]) or ""
                needed = {name for _, name, _, _ in Formatter().parse(text) if name}
                given = {each.arg for each in call.keywords}
                seen += 1
                if None not in given and not needed <= given:
                    wrong.append(f"{file}:{call.lineno}: {needed - given}")
    assert seen > 200
    assert wrong == []
