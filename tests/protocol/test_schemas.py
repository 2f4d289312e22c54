"""The schema that a file may say: the present one, which a file without it has, and no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan
from campaign.protocol.bench_file import load_bench

from .conftest import SHIPPED

PLATFORM = (SHIPPED / "benches" / "platform.toml").read_text(encoding="utf-8")
TEST = '[[test]]\nname = "a"\nkind = "stabilization"\nbench = '


def file(folder: Path, text: str, name: str = "own.toml") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


@pytest.mark.parametrize("schema", ["1", "9", "0", '"3"', "true", "3.0"])
def test_another_schema_is_refused_in_a_line_at_its_place(tmp_path: Path, schema: str):
    bench = file(tmp_path, f"schema = {schema}\n{PLATFORM}")
    named = file(tmp_path, f'{TEST}"own.toml"\n', "named.toml")
    protocol = file(tmp_path, f'schema = {schema}\n{TEST}"simulink"\n', "own-schema.toml")
    told = r"this program reads {}s of schema {}, not [^\n]*; use the program [^\n]*\Z"
    with pytest.raises(ProtocolError, match=r"own.toml:1:10: .*" + told.format("bench", 3)):
        load_bench(str(bench))
    for path, kind in ((named, ("bench", 3)), (protocol, ("protocol", 2))):
        with pytest.raises(ProtocolError, match=r"toml:1:10: .*" + told.format(*kind)):
            load_protocol(path, experiments(), shipped=SHIPPED)


def test_saying_the_schema_changes_no_trial(tmp_path: Path):
    plans = []
    for of_bench, of_protocol in (("", ""), ("schema = 3\n", "schema = 2\n")):
        file(tmp_path, of_bench + PLATFORM)
        path = file(tmp_path, f'{of_protocol}{TEST}"own.toml"\n', "p.toml")
        plans.append(make_plan(load_protocol(path, experiments(), shipped=SHIPPED), seed=1))
    assert len({plan.fingerprint for plan in plans}) == 1
    assert len({plan.trials[0].fingerprint for plan in plans}) == 1
