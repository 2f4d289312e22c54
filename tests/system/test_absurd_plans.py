"""What asks for more than a machine has is refused before the memory is spent."""

from __future__ import annotations

import re
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan, memory
from campaign.protocol.matrix import LARGEST_PLAN
from tests.forks import Forks
from tests.system.user import ROOT, environment, write

resource = pytest.importorskip("resource")  # POSIX

ROOM = 3 * 10**9
"""bytes of address space, of which numba and its libraries take up to two."""
NARROW = f"""
import resource
resource.setrlimit(resource.RLIMIT_AS, ({ROOM}, {ROOM}))
import campaign.cli.main, campaign.cli.plan
"""


@pytest.fixture(scope="module")
def narrow() -> Iterator[Forks]:
    """Commands in a narrow place."""
    made = Forks({**environment(), "OPENBLAS_NUM_THREADS": "1"}, NARROW)
    yield made
    made.close()


def plan(narrow: Forks, folder: Path) -> tuple[int, str]:
    """Exit code and standard error of `campaign plan`."""
    done = narrow.run(folder, "plan", "protocol.toml", "--allow-large")
    return done.returncode, done.stderr


def test(kind: str, more: str) -> str:
    return f'[[test]]\nname = "a"\nkind = "{kind}"\nbench = "simulink"\n{more}\n'


test.__test__ = False  # type: ignore[attr-defined]

AXES = "\n".join(
    f'"bench.{path}" = {{ start = "1 {unit}", stop = "2 {unit}", num = 10000000 }}'
    for path, unit in (
        ("axis.inertia", "kg m^2"),
        ("motor.resistance", "ohm"),
        ("motor.inductance", "H"),
    )
)
SHORT_WORDS = "1, " * 700_000

ABSURD = {
    "repeated": (
        test("stabilization", "repeat = 1_000_000_000"),
        "7e\\+03 GB.*a plan may take 1 GB",
    ),
    "repeated for ever": (test("stabilization", f"repeat = {2**63 - 1}"), "needs about 10"),
    "a fine sweep": (
        test(
            "stabilization",
            '[test.matrix]\nfrequency = { start = "1 Hz", stop = "2 Hz", num = 1000000 }',
        ),
        "1000000 points of its matrix.*sweep less",
    ),
    "a product of sweeps": (
        test("stabilization", f"[test.matrix]\n{AXES}"),
        "needs about 10.[0-9]+ GB",
    ),
    "many benches": (
        test(
            "stabilization",
            '[test.matrix]\n"bench.axis.inertia" = { start = "30 kg m^2", stop = "40 kg m^2",'
            " num = 90000 }",
        ),
        "needs about 5.13 GB",
    ),
    "more than one point tells": (
        test("frequency_response", 'highest = "100 Hz"\nstep = "0.01 Hz"\nrepeat = 1000'),
        "needs about 69.7 GB",
    ),
    "a sweep inside of a test": (
        test("frequency_response", 'step = "1e-9 Hz"'),
        "frequencies; at most",
    ),
    "long trials": (
        test("stick_slip", 'duration = "1e9 s"\nsample_rate = "100 kHz"'),
        "1e\\+14 samples; at most 2e\\+08 are allowed",
    ),
    "a long list to sweep": (
        test("velocity_map", f"[test.matrix]\nwarm_up_cycles = [{SHORT_WORDS}]"),
        "more than 200000 values",
    ),
    "too many tests": ("[[test]]\n" * 250_000, "more than 200000 values"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ABSURD)
def test_an_absurd_protocol_is_bad_usage(narrow: Forks, tmp_path: Path, name: str):
    text, message = ABSURD[name]
    write(tmp_path, text)
    code, said = plan(narrow, tmp_path)
    assert code == 2, said[:2000]
    assert said.startswith("protocol.toml")
    assert len(said) < 1000
    assert re.search(message, said), said


def test_includes_count_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Each file may be read; all of them would take what one of them may not."""
    for module in ("files", "collect"):
        monkeypatch.setattr(f"campaign.protocol.{module}.MOST_VALUES", 2000)
    for part in range(12):
        write(tmp_path, f"notes = 'x'\nx = [{'1, ' * 200}]\n", f"part-{part}.toml")
    names = ", ".join(f'"part-{part}.toml"' for part in range(12))
    path = write(tmp_path, f"include = [{names}]\n" + test("stabilization", ""))
    told = "part-9.toml: with what was included before: more than 200000 values"
    with pytest.raises(UsageError, match=told):
        load_protocol(path, experiments(), shipped=ROOT / "protocols")


def test_the_bound_is_above_what_allow_large_is_for():
    assert memory.MOST // memory.TRIAL > LARGEST_PLAN


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "bound"), [("frequency", memory.TRIAL), ("'bench.axis.inertia'", memory.BENCH)]
)
def test_a_plan_takes_no_more_than_is_counted_for_it(tmp_path: Path, axis: str, bound: int):
    """Measured: what each further trial takes while it is planned, on a bench of its own or not."""
    unit = "Hz" if axis == "frequency" else "kg m^2"

    def peak(num: int) -> int:
        sweep = f'[test.matrix]\n{axis} = {{ start = "1 {unit}", stop = "2 {unit}", num = {num} }}'
        path = write(tmp_path, test("stabilization", sweep))
        protocol = load_protocol(path, experiments(), shipped=ROOT / "protocols")
        tracemalloc.start()
        make_plan(protocol, seed=1)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(2)  # what is imported, compiled and cached
    assert peak(60) - peak(20) < 40 * (bound + memory.TRIAL)
