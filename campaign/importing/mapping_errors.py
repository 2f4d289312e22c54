"""What is wrong between a mapping and the files that it names, at the keys where it stands."""

from __future__ import annotations

Key = tuple[str | int, ...]


class MappingError(ValueError):
    """What of a mapping does not go with its files.

    Attributes:
        keys: of `[[test.recording]]` or of `[columns.NAME]`, where it stands.
        of_columns: which of the two.
        others: what is wrong besides, told together with it.
    """

    def __init__(self, message: str, keys: Key = (), *, of_columns: bool = False) -> None:
        self.keys = keys
        self.of_columns = of_columns
        self.others: tuple[MappingError, ...] = ()
        super().__init__(message)


class DefectError(MappingError):
    """A defect of a recording that nobody has accepted.

    Attributes:
        kind: of the defect, as in `clipping`.
    """

    def __init__(self, message: str, keys: Key, kind: str, *, of_columns: bool) -> None:
        super().__init__(message, keys, of_columns=of_columns)
        self.kind = kind
