"""The NeXus application definition that the trials of an archive follow, `NXfriction_trial`.

It guarantees to other programs: the minimum channels, a unit of each, and the description of the
bench. `nxvalidate` checks a file against it: `docs/reading-archives.md`.

A trial that follows the definition is marked so. A trial without samples, or without one of the
required channels, is archived without this mark.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import h5py
from h5py import h5o

from campaign.archive.writing import hdf5
from campaign.axis_kind import BOTH_ROTARY, AxisKind, Sides, axis_unit, sides_in
from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    MOTOR_CURRENT,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.recording import ChannelInfo
from campaign.trial import Tree

DEFINITION = "NXfriction_trial"
VERSION = "2.0"

REQUIRED = (COMMAND, GYRO_RATE, RELATIVE_RATE, RELATIVE_ANGLE, MOTOR_CURRENT, DRIVE_TORQUE)
"""The channels that the definition requires."""

MEMBERS = ("definition", "instrument")
"""Members of an entry that follows the definition, besides its samples."""

_SENSORS = {"gyro": GYRO_RATE, "encoder": RELATIVE_ANGLE, "current_sensor": MOTOR_CURRENT}
_GAIN_UNITS = {"rate": ("A s/rad", "A/rad"), "current": ("V/A", "V/(A s)")}


def definition_path() -> Path:
    """Path of the definition, for validators: `nxvalidate -a FILE`."""
    return Path(__file__).with_name(f"{DEFINITION}.nxdl.xml")


def follows_definition(channels: Iterable[ChannelInfo]) -> bool:
    """Whether a recording of these channels follows the definition."""
    return {channel.name for channel in channels}.issuperset(REQUIRED)


def write_definition(entry: h5py.Group, bench: InstrumentDescription) -> None:
    """Mark `entry` as following the definition, and describe its bench."""
    hdf5.put_text(entry, "definition", DEFINITION, version=VERSION)
    h5o.copy(_template(bench).id, b"instrument", entry.id, b"instrument")


def differences(entry: h5py.Group, bench: InstrumentDescription) -> Iterator[tuple[str, str]]:
    """Members of definition and instrument that differ from the bench: name and problem."""
    definition = entry["definition"]
    if definition[()] != DEFINITION.encode() or definition.attrs.get("version") != VERSION:
        yield "definition", f"is not {DEFINITION} {VERSION}"
    wanted: dict[str, h5py.Dataset] = {}
    _template(bench)["instrument"].visititems(
        lambda name, item: wanted.update({name: item} if isinstance(item, h5py.Dataset) else {})
    )
    for name, expected in wanted.items():
        actual = entry["instrument"].get(name)
        same = isinstance(actual, h5py.Dataset) and actual[()] == expected[()]
        if not same or actual.attrs.get("units") != expected.attrs.get("units"):
            yield f"instrument/{name}", "is not what the bench in the record says"


@dataclass(frozen=True)
class InstrumentDescription:
    """Bench data in an instrument: name, and gains as (loop, proportional, integral).

    An archive may contain benches of any origin, so their layout is not assumed.
    """

    name: str
    gains: tuple[tuple[str, float, float], ...]
    sides: Sides = BOTH_ROTARY

    @classmethod
    def of(cls, bench: Tree) -> InstrumentDescription:
        loops = bench.get("controller")
        gains = (
            (loop, *pair)
            for loop in _GAIN_UNITS
            if isinstance(loops, Mapping) and (pair := _parallel_gains(loops.get(loop)))
        )
        return cls(str(bench.get("name", "")), tuple(gains), sides_in(bench))


@lru_cache(maxsize=32)
def _template(bench: InstrumentDescription) -> h5py.File:
    """A file in memory with the instrument, to copy from."""
    file = hdf5.memory_file("instrument")
    instrument = hdf5.make_group(file, "instrument", "NXinstrument")
    hdf5.put_text(instrument, "name", bench.name)
    for name, channel in _SENSORS.items():
        sensor = hdf5.make_group(instrument, name, "NXsensor")
        hdf5.put_text(sensor, "short_name", channel)
    motor = hdf5.make_group(instrument, "motor", "NXactuator")
    turns = bench.sides.motor is AxisKind.ROTARY
    hdf5.put_text(motor, "physical_quantity", "torque" if turns else "force")
    for loop, proportional, integral in bench.gains:
        controller = hdf5.make_group(motor, f"{loop}_controller", "NXpid_controller")
        unit, integral_unit = (axis_unit(each, bench.sides) for each in _GAIN_UNITS[loop])
        hdf5.put_number(controller, "K_p", proportional, units=unit)
        hdf5.put_number(controller, "K_i", integral, units=integral_unit)
    return file


def _parallel_gains(controller: object) -> tuple[float, float] | None:
    """Proportional and integral gain (SI, parallel form) of a controller; None if not stated."""
    if not isinstance(controller, Mapping):
        return None
    proportional, integral = controller.get("proportional"), controller.get("integral")
    if not isinstance(proportional, int | float) or not isinstance(integral, int | float):
        return None
    ideal = controller.get("form") == "ideal"  # the proportional gain multiplies its integral gain
    return float(proportional), float(proportional * integral if ideal else integral)
