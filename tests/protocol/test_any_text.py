"""Whatever a file contains, it loads or is refused with a ProtocolError."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.errors import ProtocolError
from campaign.protocol import load_protocol, make_plan

from .conftest import KINDS, SHIPPED
from .toml_mutations import VALUES

BENCH = (SHIPPED / "benches" / "simulink.toml").read_text()
SCALARS = [
    *VALUES, '"own.toml"', '"protocol.toml"', '["none", "lugre"]', '["0.1 Hz", "0.2 Hz"]',
    '"speeds"', '"swing"', '"t"', '"1 kg**9999999"', '"1e308 kHz"', "1e400",
    '{ model = "stribeck" }',
]  # fmt: skip
KEYS = [
    "name", "name", "kind", "bench",
    "frequency", "cycles", "gain", "style", "flag", "speeds", "matrix",
    "repeat", "order", "seed", "compensation", "include", "title", "tags", "published", "x",
    "matrix.frequency", 'matrix."bench.axis.inertia"', "matrix.bench.friction.load", "axis.inertia",
    "friction.load.model", "compensation.observer.gain", "limits", "controller.rate.form", "test",
    '"a b"', "matrix.speeds", "matrix.bench", "matrix.x.y", "given", "friction", "reproduces",
]  # fmt: skip

lines = st.one_of(
    st.sampled_from(
        ["[[test]]", "[test]", "[test.matrix]", "[axis]", "[friction.load]", "[[test.x]]"]
    ),
    st.builds("{} = {}".format, st.sampled_from(KEYS), st.sampled_from(SCALARS)),
    st.text(max_size=20),
)
good = st.just('[[test]]\nname = "t"\nkind = "swing"\nbench = "own.toml"\nfrequency = "1 Hz"\n')
protocols = st.one_of(
    st.text(max_size=200), st.lists(lines, max_size=12).map("\n".join),
    st.tuples(good, st.lists(lines, max_size=4).map("\n".join)).map("".join),
)  # fmt: skip
benches = st.one_of(
    st.just(BENCH), lines.map(lambda line: f"{line}\n{BENCH}"), st.text(max_size=50)
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(protocols, benches, st.lists(st.text(max_size=30), max_size=2))
def test_any_text(protocol: str, bench: str, overrides: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("protocol.toml", protocol), ("own.toml", bench)):
            (Path(folder) / name).write_bytes(text.encode(errors="replace"))
        try:
            path = Path(folder) / "protocol.toml"
            make_plan(load_protocol(path, KINDS, overrides=overrides, shipped=SHIPPED))
        except ProtocolError as error:
            problems = error.problems
        else:
            return
    assert problems
    for problem in problems:
        assert problem.message
        assert (problem.line > 0) == (problem.column > 0)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=40))
def test_any_bytes(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "protocol.toml"
        path.write_bytes(content)
        # No forty bytes make a valid test: a name, a kind, a bench and its options are longer.
        with pytest.raises(ProtocolError):
            load_protocol(path, KINDS, shipped=SHIPPED)
