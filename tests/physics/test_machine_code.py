"""What is compiled ahead is all that the shipped benches need."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from numba import typeof

import campaign.physics.simulate
from campaign.physics import friction_elements, machine_code
from campaign.physics.bench import Bench
from campaign.physics.compilation import compiled
from campaign.physics.friction import friction_models
from campaign.physics.lanes import Lane
from campaign.physics.machine_code import WIDTHS, Part, is_made, make, note_made, parts
from campaign.physics.simulate import simulate_together
from campaign.physics.step_function import compiled_step
from campaign.physics.vector import LANES
from campaign.protocol.bench_file import load_bench
from campaign.resources import shipped_benches
from campaign.signals import Sine
from campaign.trial import Task

SINE = Sine(amplitude=0.1, frequency=1.0)
ENTRIES = ("advance_one", "advance_block", "drive_one", "drive_block")


@pytest.fixture(scope="module")
def benches() -> list[Bench]:
    return [load_bench(name) for name in shipped_benches()]


Asked = set[tuple[Any, ...]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Which machine code is asked for, in place of compiling and running it."""
    asked: Asked = set()

    def entry(name: str) -> Callable[..., None]:
        return lambda *arguments: asked.add((name, *map(typeof, arguments)))

    def address(*what: Any) -> int:
        asked.add(what)
        return 0

    for name in ENTRIES:
        monkeypatch.setattr(campaign.physics.simulate, name, entry(name))
    for name in ("address_of", "address_of_sliding"):
        monkeypatch.setattr(friction_elements, name, address)
    return asked


def simulate_all(benches: list[Bench]) -> None:
    """Every bench in every mode with every compensation, alone and in company."""
    for bench in benches:
        rate = bench.controller.sample_rate or 1000.0
        tasks = [
            Task(
                mode=mode,
                command=SINE,
                base_acceleration=SINE,
                compensation=compensation,
                duration=2.5 / rate,
                window=(0.0, 0.0),
                sample_rate=rate,
                **({"spring_stiffness": 10.0} if mode == "spring" else {}),
            )
            for mode in ("rate", "torque", "prescribed", "spring")
            for compensation in (["none", *bench.compensation] if mode != "spring" else ["none"])
        ]
        for task in tasks:
            for together in (1, 2):
                for _ in simulate_together([Lane.of(bench, task, 1)] * together):
                    pass


def test_the_parts_are_all_that_the_shipped_benches_need(benches, asked: Asked) -> None:
    for width in WIDTHS:
        for part in parts(width, benches):
            part.make()
    made = set(asked)
    assert {what[0] for what in made if isinstance(what[0], str)} == {*ENTRIES}
    asked.clear()
    simulate_all(benches)
    assert asked == made


def test_parts_have_names_of_their_own(benches) -> None:
    names = [part.name for width in WIDTHS for part in parts(width, benches)]
    assert len(names) == len(set(names))


def test_a_part_says_whether_it_had_to_be_compiled() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    twice.__module__ = "__nowhere__"  # so that it is not kept
    function = compiled(twice)
    part = Part("twice", lambda: function(1.0))
    assert make(part).compiled
    assert not make(part).compiled


def test_all_is_made_for_one_width_and_one_processor(tmp_path, monkeypatch) -> None:
    """Of one folder, which is that of the sources (`compiled.digest_of_sources`)."""
    monkeypatch.setattr(machine_code, "folder", lambda: tmp_path)
    assert not is_made(1)
    note_made(1)
    assert is_made(1)
    assert not is_made(LANES)
    monkeypatch.setattr(machine_code.binding, "get_host_cpu_name", lambda: "another")
    assert not is_made(1)


def test_a_temporary_cache_is_none(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(machine_code, "cache_folder", lambda module: tmp_path)
    assert machine_code.folder() is None


def test_where_nothing_can_be_kept_nothing_is_said_to_be(monkeypatch) -> None:
    monkeypatch.setattr(machine_code, "folder", lambda: None)
    note_made(1)
    assert not is_made(1)


def test_each_step_function_has_a_file_of_its_own() -> None:
    """Two processes that add to one file of numba's cache at a time can exchange what is in it."""
    model = friction_models()["lugre"]
    sizes = [(1, 1, 11, 1), (LANES, 1, 11, 1), (1, 2, 11, 1), (1, 1, 12, 1)]
    files = {compiled_step(model.step, *size)._cache._impl.filename_base for size in sizes}
    assert len(files) == len(sizes)
