"""Untrusted text as LaTeX, without commands.

What is written needs pdfLaTeX, LuaLaTeX or XeLaTeX with the T1 encoding and nothing else. A letter
that T1 has not is named by its code point, so that no text of a run stops the typesetting.
"""

from __future__ import annotations

import re
import unicodedata

_COMMANDS = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
    # Behind a line's end these two are taken for its arguments, wherever the text began.
    "[": "{[}",
    "]": "{]}",
    "*": "{*}",
    "–": r"\textendash{}",
    "—": r"\textemdash{}",
    "…": r"\ldots{}",
    "‘": r"\textquoteleft{}",
    "’": r"\textquoteright{}",
    "“": r"\textquotedblleft{}",
    "”": r"\textquotedblright{}",
    "§": r"\S{}",
    "·": r"\textperiodcentered{}",
    "°": r"\textdegree{}",
    "€": r"\texteuro{}",
    "©": r"\textcopyright{}",
    "®": r"\textregistered{}",
}
_MATHS = {
    "−": "-",
    "±": r"\pm",
    "×": r"\times",
    "÷": r"\div",
    "≤": r"\leq",
    "≥": r"\geq",
    "≠": r"\neq",
    "≈": r"\approx",
    "∞": r"\infty",
    "√": r"\surd",
    "∑": r"\sum",
    "∫": r"\int",
    "∂": r"\partial",
    "✓": r"\surd",
    "→": r"\rightarrow",
    "←": r"\leftarrow",
    "↑": r"\uparrow",
    "↓": r"\downarrow",
    "∝": r"\propto",
    "µ": r"\mu",
}
_GREEK = "αβγδεζηθικλμνξπρςστυφχψωΓΔΘΛΞΠΣΥΦΨΩ"
"""The letters that have a command of their name."""
_LIKE_LATIN = dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΧο", "ABEZHIKMNOPTXo", strict=True))
"""Greek letters that mathematics has no command for, because it writes them as Latin ones."""
_T1 = frozenset(
    "ÀÁÂÃÄÅÆÇÈÉÊËÌÍÎÏÐÑÒÓÔÕÖØÙÚÛÜÝÞßàáâãäåæçèéêëìíîïðñòóôõöøùúûüýþÿ"
    "ĂăĄąĆćČčĎďĐđĘęĚěĞğİıŁłŃńŇňŊŋŐőŒœŔŕŘřŚśŞşŠšŢţŤťŮůŰűŸŹźŻżŽž"
)
"""Letters beyond ASCII that the T1 encoding has."""
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ", "0123456789+-n")
_LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉₊₋", "0123456789+-")
_PIECES = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ]+|[₀₁₂₃₄₅₆₇₈₉₊₋]+|.", re.DOTALL)
"""The digits of one exponent belong together; all else is taken letter by letter."""


LONGEST, PART = 24, 8
"""Letters of a word that is left whole, and of the parts of a longer one."""


def latex(text: str) -> str:
    """`text` within a paragraph, a caption or a cell: one line, in which nothing is a command."""
    line = unicodedata.normalize("NFC", " ".join(text.split()))
    return "".join(_piece(match[0], line[match.end() :][:1]) for match in _PIECES.finditer(line))


def breakable(text: str) -> str:
    """The same, but lines may break within a long word, such as a digest or a path."""
    return " ".join(r"\allowbreak{}".join(map(latex, _parts(word))) for word in text.split())


def _parts(word: str) -> list[str]:
    if len(word) <= LONGEST:
        return [word]
    return [word[start : start + PART] for start in range(0, len(word), PART)]


def _piece(piece: str, following: str) -> str:
    letter = piece[0]
    if ord(letter) in _RAISED:
        return rf"\ensuremath{{^{{{piece.translate(_RAISED)}}}}}"
    if ord(letter) in _LOWERED:
        return rf"\ensuremath{{_{{{piece.translate(_LOWERED)}}}}}"
    if letter in "-,'" and following == letter:  # would be a dash, or a quote
        return letter + "{}"
    if letter in _COMMANDS:
        return _COMMANDS[letter]
    if letter in _MATHS:
        return rf"\ensuremath{{{_MATHS[letter]}}}"
    if letter in _GREEK:
        name = unicodedata.name(letter).split()[-1].replace("LAMDA", "LAMBDA")
        return rf"\ensuremath{{\{name.capitalize() if letter.isupper() else name.lower()}}}"
    if " " <= letter <= "~" or letter in _T1:
        return letter
    return _LIKE_LATIN.get(letter) or f"{{[}}U+{ord(letter):04X}{{]}}"
