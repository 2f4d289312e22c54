"""The entry of a trial in a sealed file: an NXentry, made from the trial's own file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, Self

import h5py
import numpy as np
from h5py import h5d, h5o

from campaign.archive.layout.packed_trial import PackedSeries, PackedTrial
from campaign.archive.layout.record import TrialRecord
from campaign.archive.reading.archived_samples import TIME
from campaign.archive.reading.series import Series, dataset_series
from campaign.archive.writing import hdf5
from campaign.archive.writing.default_plot import Aim, beside
from campaign.recording import ChannelInfo

_MOST_FORMS = 256
"""Largest number of template groups in memory."""


class EntryWriter:
    """Writer of the entries of trials in a sealed file.

    Groups of samples that differ only in samples are created once, in memory, and copied.
    """

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._forms: dict[_Form, bytes] = {}
        self._made = hdf5.memory_file("samples")

    def write(
        self, name: str, record: TrialRecord, packed: PackedTrial, source: BinaryIO
    ) -> dict[tuple[str, str], tuple[h5d.DatasetID, Series]]:
        """Write a trial with its chunks in `source`; return its series by group and name."""
        entry = hdf5.make_group(self._file, name, "NXentry")
        if packed.groups:
            shown = "preview" if "preview" in packed.groups else "data"
            hdf5.put_attribute(entry, "default", shown)
        hdf5.put_text(entry, "title", record.label)
        hdf5.put_text(entry, "start_time", record.started)
        hdf5.put_text(entry, "end_time", record.ended)
        kept = hdf5.make_group(entry, "record", "NXcollection")
        hdf5.put_text(kept, "json", packed.record)
        hdf5.put_text(kept, "trees", packed.trees)
        written = {}
        for group, series in packed.groups.items():
            form = _Form.of(group, record, series)
            template = self._template(form)
            h5o.copy(self._made.id, template, entry.id, group.encode())
            data = entry[group]
            hdf5.link(entry, "title", data, "title")  # viewers expect it beside the samples
            for each in series:
                dataset = h5d.open(data.id, each.name.encode())
                for number, (offset, size) in enumerate(each.chunks):
                    source.seek(offset)
                    dataset.write_direct_chunk((number * each.chunk,), source.read(size))
                spec = form.length, each.chunk, each.shuffled
                written[group, each.name] = dataset, dataset_series(dataset, data, each.name, *spec)
            hdf5.attach_time(data)
        return written

    def _template(self, form: _Form) -> bytes:
        """Name of the template group without samples, created on first use."""
        if form not in self._forms:
            if len(self._forms) == _MOST_FORMS:
                self._forms.clear()
                self._made = hdf5.memory_file("samples")
            name = f"form_{len(self._forms)}"
            form.make(self._made, name)
            self._forms[form] = name.encode()
        return self._forms[form]


@dataclass(frozen=True)
class _Form:
    """Common properties of groups of samples that differ only in samples.

    Attributes:
        signal, others: the channels that viewers plot.
        length: samples per series.
        series: the channel, samples per chunk, and whether chunks are shuffled.
    """

    signal: str
    others: tuple[str, ...]
    length: int
    series: tuple[tuple[ChannelInfo, int, bool], ...]

    @classmethod
    def of(cls, group: str, record: TrialRecord, series: Sequence[PackedSeries]) -> Self:
        infos = {info.name: info for info in (TIME, *record.series)}
        layouts = tuple((infos[each.name], each.chunk, each.shuffled) for each in series)
        if group == "preview" and record.preview is not None:
            return cls(record.preview.channel, (), record.preview.samples, layouts)
        names = [info.name for info in record.series]
        signal = Aim.of_tree(record.trial).channel(names)
        others = tuple(beside(infos[signal], record.series))
        return cls(signal, others, record.samples or 0, layouts)

    def make(self, file: h5py.File, name: str) -> None:
        """Create the group, without samples."""
        group = hdf5.make_group(file, name, "NXdata")
        hdf5.put_attribute(group, "signal", self.signal)
        if self.others:
            group.attrs["auxiliary_signals"] = self.others
        group.attrs["axes"] = ["time"]
        group.attrs["time_indices"] = np.array([0], dtype="<i4")
        for info, chunk, shuffled in self.series:
            made = hdf5.create_series(group, info.name, self.length, chunk, shuffled)
            dataset = h5py.Dataset(made)
            hdf5.put_attribute(dataset, "units", info.unit)
            hdf5.put_attribute(dataset, "long_name", info.long_name)
