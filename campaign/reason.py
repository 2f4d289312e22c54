"""Why a number has no interval, is not determined, or was left out: codes with named values.

Logic compares codes; a reader is shown the text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pydantic import model_validator

Named = tuple[tuple[str, float | int | str | bool | None], ...]


@dataclass(frozen=True)
class Reason:
    """One reason; false where there is none.

    Attributes:
        code: which one, e.g. `too few samples`; `text` for one that an older archive has in words.
        text: the same in English, with its values.
        values: what the text has in it, by name (SI, or a percentage called so).
    """

    code: str = ""
    text: str = ""
    values: Named = ()

    @model_validator(mode="before")
    @classmethod
    def _of_an_older_archive(cls, given: Any) -> Any:
        """Formerly a reason was its text."""
        return {"code": OLDER if given else "", "text": given} if isinstance(given, str) else given

    def __bool__(self) -> bool:
        return bool(self.code)

    def __str__(self) -> str:
        return self.text

    def columns(self) -> dict[str, object]:
        """As tables and JSON have it: the text, the code, and the values by name."""
        return {
            "reason": self.text, "reason_code": self.code, "reason_values": dict(self.values)
        }  # fmt: skip


NONE = Reason()
OLDER = "text"
"""Code of a reason that an older archive has in words."""


@dataclass(frozen=True)
class Cause:
    """A kind of reason, declared once, where it is raised.

    Called with its values it is a `Reason`: `TOO_FEW(samples=5, batches=10)`. `{names}` in `text`
    are replaced by them, formatted as `str.format` does.
    """

    code: str
    text: str

    def __call__(self, **values: float | int | str | bool | Reason | None) -> Reason:
        text = self.text.format(**values)
        return Reason(self.code, text, tuple((name, _plain(it)) for name, it in values.items()))

    def __contains__(self, reason: Reason) -> bool:
        """Whether a reason is of this kind; one of an older archive is known by its text."""
        return reason.code == self.code or (reason.code == OLDER and reason.text == self.text)


def _plain(value: Any) -> float | int | str | bool | None:
    """As an archive has it: a reason within a reason by its code, no number that is not finite."""
    if isinstance(value, Reason):
        return value.code
    value = getattr(value, "item", lambda: value)()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float) else str(value)
