"""Conversion of untrusted text to LaTeX without commands.

The result needs only pdfLaTeX, LuaLaTeX or XeLaTeX with the T1 encoding. A letter that is not in T1
is replaced by its code point, so that no text of a run stops the typesetting.
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
    # After the end of a line, LaTeX takes a bracket or an asterisk as its argument.
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
    "†": r"\textdagger{}",
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
"""Letters with a command of their name."""
_LIKE_LATIN = dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΧο", "ABEZHIKMNOPTXo", strict=True))
"""Greek letters without a command, because they look like Latin letters."""
_T1 = frozenset(
    "ÀÁÂÃÄÅÆÇÈÉÊËÌÍÎÏÐÑÒÓÔÕÖØÙÚÛÜÝÞßàáâãäåæçèéêëìíîïðñòóôõöøùúûüýþÿ"
    "ĂăĄąĆćČčĎďĐđĘęĚěĞğİıŁłŃńŇňŊŋŐőŒœŔŕŘřŚśŞşŠšŢţŤťŮůŰűŸŹźŻżŽž"
)
"""Letters of the T1 encoding beyond ASCII."""
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ", "0123456789+-n")
_LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉₊₋", "0123456789+-")
_SYMBOLS = {
    **{f"σ{n}": rf"\sigma_{n}" for n in "012"},
    "Tc": r"T_\mathrm{c}",
    "Ts": r"T_\mathrm{s}",
    "vs": r"v_\mathrm{s}",
}
"""Symbols of the LuGre model, as separate words."""
_WORDS = re.compile(rf"(?<!\w)(?:{'|'.join(_SYMBOLS)})(?!\w)(?<!vs(?=\.))")
_PIECES = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ]+|[₀₁₂₃₄₅₆₇₈₉₊₋]+|.", re.DOTALL)
"""Pieces of a text: the digits of one exponent or index, or else one letter."""


LONGEST, PART = 24, 8
"""Maximum length of a word without breaks, and length of the parts of a longer one."""


def latex(text: str) -> str:
    """Convert text for a paragraph, a caption or a cell: one line without commands of its own."""
    line = unicodedata.normalize("NFC", " ".join(text.split()))
    done, written = 0, ""
    for match in _WORDS.finditer(line):
        written += _letters(line[done : match.start()])
        written += rf"\ensuremath{{{_SYMBOLS[match[0]]}}}"
        done = match.end()
    return written + _letters(line[done:])


def _letters(line: str) -> str:
    return "".join(_piece(match[0], line[match.end() :][:1]) for match in _PIECES.finditer(line))


def breakable(text: str) -> str:
    """Convert as `latex`, with permitted breaks in long words such as a digest or a path."""
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


_PREFIXES = {"n": "nano", "µ": "micro", "m": "milli", "k": "kilo", "M": "mega"}
_UNITS = {
    "N": "newton",
    "m": "metre",
    "s": "second",
    "rad": "radian",
    "deg": "degree",
    "°": "degree",
    "°C": "degreeCelsius",
    "degC": "degreeCelsius",
    "Hz": "hertz",
    "A": "ampere",
    "V": "volt",
    "Ω": "ohm",
    "H": "henry",
    "J": "joule",
    "W": "watt",
    "g": "gram",
    "K": "kelvin",
    "dB": "decibel",
    "%": "percent",
    "min": "minute",
    "h": "hour",
}
_POWERS = {"²": r"\squared", "³": r"\cubed"}
_ONE = r"[-−+]?\d+(?:\.\d+)?"
_POWER = r" × 10(?P<{}>[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)"
_NUMBER = re.compile(
    rf"\((?P<all>{_ONE} ± {_ONE})\){_POWER.format('of_all')}"
    rf"|(?<![\w.])(?P<one>{_ONE}(?: ± {_ONE})?)(?:{_POWER.format('of_one')})?(?![\w.])"
)


def cell_numbers(text: str) -> str:
    r"""Convert a cell, numbers for siunitx: `3.87 ± 0.12` is `\num{3.87 \pm 0.12}`."""
    done, tex = 0, []
    for match in _NUMBER.finditer(text):
        number = (match["all"] or match["one"]).replace("−", "-").replace("±", r"\pm")
        power = (match["of_all"] or match["of_one"] or "").translate(_RAISED)
        tex += [_between(text[done : match.start()]), rf"\num{{{number}{power and ' e' + power}}}"]
        done = match.end()
    return "".join((*tex, _between(text[done:])))


def _between(text: str) -> str:
    """Convert words between numbers, with the spaces around them."""
    before, after = text[:1] == " ", text[-1:] == " " and bool(text.strip())
    return " " * before + latex(text) + " " * after


def column_head(text: str) -> str:
    r"""Convert a heading, its unit for siunitx: `Error (\unit{\milli\radian})`."""
    match = re.fullmatch(r"(.*) \(([^()]*)\)", text)
    shown = unit(match[2]) if match else ""
    return f"{breakable(match[1])} ({shown})" if match and shown else breakable(text)


def unit(text: str) -> str:
    """Convert a unit of the page (`N·m/rad`) for siunitx; "" for an unknown one."""
    macros = []
    for place, part in enumerate(text.split("/")):
        for factor in part.split("·"):
            macro = "" if (place, factor) == (0, "1") else _factor(factor)
            if macro is None:
                return ""
            macros.append(rf"\per{macro}" if place else macro)
    return rf"\unit{{{''.join(macros)}}}"


def _factor(text: str) -> str | None:
    """Convert one factor of a unit for siunitx; None for an unknown one."""
    name, power = (text[:-1], _POWERS[text[-1]]) if text[-1:] in _POWERS else (text, "")
    if name in _UNITS:
        return rf"\{_UNITS[name]}{power}"
    if name[:1] in _PREFIXES and name[1:] in _UNITS:
        return rf"\{_PREFIXES[name[0]]}\{_UNITS[name[1:]]}{power}"
    return None
