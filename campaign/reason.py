"""Reasons for a missing interval, an undetermined number, or an exclusion: codes with named values.

Logic compares codes; the page shows the text.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pydantic import model_validator

Named = tuple[tuple[str, float | int | str | bool | None], ...]


@dataclass(frozen=True)
class Reason:
    """One reason; an empty reason is false.

    Attributes:
        code: e.g. `too few samples`; `text` for a reason from an older archive with a text only.
        text: the reason in English, with its values.
        values: values in the text by name (SI, or a percentage named `percent`).
    """

    code: str = ""
    text: str = ""
    values: Named = ()

    @model_validator(mode="before")
    @classmethod
    def _of_an_older_archive(cls, given: Any) -> Any:
        """Convert a reason of an older archive, which is a text."""
        return {"code": OLDER if given else "", "text": given} if isinstance(given, str) else given

    def __bool__(self) -> bool:
        return bool(self.code)

    def __str__(self) -> str:
        return self.text

    def columns(self) -> dict[str, object]:
        """Columns of tables and JSON: the text, the code, and the values by name."""
        return {
            "reason": self.text, "reason_code": self.code, "reason_values": dict(self.values)
        }  # fmt: skip


NONE = Reason()
OLDER = "text"
"""Code of a reason from an older archive with a text only."""


@dataclass(frozen=True)
class Cause:
    """A kind of reason, declared once by the code that states it.

    A call with values returns a `Reason`: `TOO_FEW(samples=5, batches=10)`. `str.format` replaces
    `{names}` in `text` by them.
    """

    code: str
    text: str

    def __call__(self, **values: float | int | str | bool | Reason | None) -> Reason:
        text = self.text.format(**values)
        return Reason(self.code, text, tuple((name, _plain(it)) for name, it in values.items()))

    def __contains__(self, reason: Reason) -> bool:
        """Whether a reason is of this kind; for an older archive the text is compared."""
        return reason.code == self.code or (reason.code == OLDER and reason.text == self.text)


def _plain(value: Any) -> float | int | str | bool | None:
    """Archived form of a value: the code of a nested reason; None for infinite numbers and NaN."""
    if isinstance(value, Reason):
        return value.code
    value = getattr(value, "item", lambda: value)()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float) else str(value)
