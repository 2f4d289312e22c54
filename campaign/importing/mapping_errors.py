"""What is wrong between a mapping and the files that it names, at the keys where it stands."""

from __future__ import annotations

from collections.abc import Sequence

Key = tuple[str | int, ...]


class MappingError(ValueError):
    """What of a mapping does not go with its files.

    Attributes:
        keys: of `[[test.recording]]` or of `[columns.NAME]`, where it stands.
        of_columns: which of the two.
        defect: the kind of what was found in the samples and nobody has accepted, as `clipping`.
        others: what is wrong besides, told together with it.
    """

    def __init__(
        self, message: str, keys: Key = (), *, of_columns: bool = False, defect: str = ""
    ) -> None:
        self.keys = keys
        self.defect = defect
        self.of_columns = of_columns
        self.others: tuple[MappingError, ...] = ()
        super().__init__(message)

    @classmethod
    def together(cls, faults: Sequence[MappingError]) -> None:
        """Raise the first with the others; nothing where there are none."""
        if faults:
            later = (each for one in faults[1:] for each in (one, *one.others))
            faults[0].others = (*faults[0].others, *later)
            raise faults[0]
