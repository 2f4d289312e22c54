"""The seal of a run: the digest of every text, and reading texts by it.

The index is one of the texts and holds the record of every trial, so the digest of the seal covers
the whole run. A signature signs this digest.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
from pydantic import ValidationError

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.header import FORMAT, ArchivedModel
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.damage import DamageList
from campaign.errors import ArchiveError
from campaign.trial import canonical_json

SEAL = "outcome/seal"

OUTSIDE = frozenset({SEAL, "outcome/file_sha256", "not_kept/type", "not_kept/file_name"}) | {
    "not_kept/data"
}
"""Members of `/run` that the seal does not cover: itself, the hash of the file, and the list of
samples not kept, so that samples may be removed from a signed run."""


NUMBERS = ("outcome/trials_finished", "outcome/trials_failed", "provenance/format")
"""Members of `/run` that are integers; all others are texts."""


class Seal(ArchivedModel):
    """Digests of a run's texts by their place in `/run`; for a number, of its digits."""

    format: int
    run: str
    texts: dict[str, str]


def seal_text(run: str, digests: Mapping[str, str]) -> str:
    """The seal, from the digests of texts by their place in `/run`."""
    return canonical_json({"format": FORMAT, "run": run, "texts": dict(digests)})


class SealedTexts:
    """The texts of `/run`, each checked against the seal. If the seal is damaged, each is checked
    against its own checksum, which detects damage but no exchange.

    Attributes:
        root: digest of the seal; empty if it is unreadable.
        seal: None if it is unreadable.
    """

    def __init__(self, path: Path, file: h5py.File, damaged: DamageList) -> None:
        self._path = path
        self._run = safe_hdf5.inner_group(file, "run")
        self.root, self.seal = "", None
        with damaged.noting(), self._at(SEAL) as member:
            text = safe_hdf5.text_at(*member)
            try:
                self.seal = Seal.model_validate_json(text)
            except ValidationError as error:
                raise ArchiveError(f"{path}: /run/{SEAL}: {first_line(error)}") from None
            self.root = text_digest(text)

    def names(self, group: str) -> list[str]:
        """Members of the group `group` in `/run`, now or when it was sealed."""
        sealed = self.seal.texts if self.seal else {}
        present = safe_hdf5.names(safe_hdf5.inner_group(self._run, group))
        inside = f"{group}/"
        sealed_names = (place.removeprefix(inside) for place in sealed if place.startswith(inside))
        return sorted({*present, *sealed_names})

    def notes(self, prefix: str) -> list[str]:
        """Names in `/run` that begin with `prefix`, now or when it was sealed."""
        sealed = self.seal.texts if self.seal else {}
        names = {*safe_hdf5.names(self._run), *(place.partition("/")[0] for place in sealed)}
        return sorted(name for name in names if name.startswith(prefix))

    def text(self, place: str) -> str:
        """A text of `/run`, e.g. `title`. Raises ArchiveError if it is damaged."""
        with safe_hdf5.guarded(self._path, f"/run/{place}"):
            return self.raw(place).decode("utf-8")

    def raw(self, place: str) -> bytes:
        """A text of `/run` in UTF-8, e.g. `journal/data`. Raises ArchiveError if damaged."""
        with self._at(place) as member:
            return safe_hdf5.raw_text_at(*member, self._digest(place))

    def unchecked(self, place: str) -> bytes:
        """A text of `/run` in UTF-8 without a check; empty if it cannot be read."""
        with contextlib.suppress(ArchiveError), self._at(place) as member:
            return safe_hdf5.unchecked_raw_text_at(*member)
        return b""

    def line_digests(self, place: str) -> list[str]:
        """SHA-256 of each line of a text of `/run`; empty if it cannot be read."""
        with contextlib.suppress(ArchiveError), self._at(place) as member:
            return list(safe_hdf5.line_digests_at(*member))
        return []

    def integer(self, place: str) -> int:
        """An integer of `/run`. Raises ArchiveError if it is damaged."""
        with self._at(place) as member:
            return safe_hdf5.integer_at(*member, self._digest(place))

    def check(self, place: str) -> None:
        """Check a text or a number of `/run`. Raises ArchiveError if it is damaged."""
        if place in NUMBERS:
            self.integer(place)
        else:
            with self._at(place) as member:
                safe_hdf5.check_text_at(*member, self._digest(place))

    @contextlib.contextmanager
    def _at(self, place: str) -> Iterator[tuple[h5py.Group, str]]:
        """Group and name of a member of `/run`; failures in the block are ArchiveErrors."""
        with safe_hdf5.guarded(self._path, f"/run/{place}"):
            group, _, name = place.rpartition("/")
            yield (safe_hdf5.inner_group(self._run, group) if group else self._run), name

    def _digest(self, place: str) -> str | None:
        if self.seal is None or place in OUTSIDE:
            return None
        if place not in self.seal.texts:
            raise ArchiveError(f"{self._path}: /run/{place}: was not there when the run was sealed")
        return self.seal.texts[place]
