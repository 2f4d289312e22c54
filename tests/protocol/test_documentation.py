"""What docs/protocols.md shows is what happens."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.physics.bench_knowledge import KnownOptions
from campaign.physics.complete import lacking
from campaign.protocol import ProtocolFile, TestEntry, check_limits, load_protocol, make_plan
from campaign.protocol.bench_file import load_bench

from .conftest import SHIPPED

PAGE = (SHIPPED.parent / "docs" / "protocols.md").read_text()


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "trials"), list(zip(blocks("toml"), [4, 72, 2, 15], strict=True))
)
def test_example(tmp_path: Path, block: str, trials: int) -> None:
    path = tmp_path / "my.toml"
    path.write_text(block)
    plan = make_plan(load_protocol(path, experiments(), shipped=SHIPPED))
    check_limits(plan)
    assert len(plan.trials) == trials


def test_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (text,), (shown,) = blocks("toml bad"), blocks("text")
    Path("bad.toml").write_text(text)
    with pytest.raises(ProtocolError) as caught:
        load_protocol(Path("bad.toml"), experiments(), shipped=SHIPPED)
    # More kinds and benches may exist by now than the page lists.
    listed = re.compile(r"(; allowed are )[^;]*(?=;)")
    assert listed.sub(r"\1…", str(caught.value)) == listed.sub(r"\1…", shown.strip())


def test_parts_of_the_page(tmp_path: Path) -> None:
    operator, check, faults = blocks("toml part")
    head = "[[test]]\nname = 'reference'\nkind = 'step_response'\nbench = 'platform'\n"
    sweep = "[test.matrix]\n'bench.gear.preload.torque' = ['33 N m', '50 N m']\n"
    path = tmp_path / "my.toml"
    path.write_text(head + operator + sweep + check + faults)
    protocol = load_protocol(path, experiments(), shipped=SHIPPED)
    assert protocol.check is not None
    assert protocol.policy.rest is not None
    trial = make_plan(protocol).trials[-1]
    assert trial.setup == ("Preload the spring to 50 N m", "Remove the transport lock")


def test_a_linear_bench_of_the_page(tmp_path: Path) -> None:
    (block,) = blocks("toml linear")
    shipped = (SHIPPED / "benches" / "linear.toml").read_text(encoding="utf-8")
    rest = shipped[shipped.index("[friction.load]") :]
    path = tmp_path / "linear.toml"
    path.write_text(f'name = "linear"\n{block}\n{rest}', encoding="utf-8")
    bench, own = load_bench(str(path)), load_bench("linear")
    assert bench.model_copy(update={"description": own.description}) == own


def test_a_bench_of_a_data_sheet_of_the_page(tmp_path: Path) -> None:
    (block,) = blocks("toml sheet")
    (tmp_path / "motor.toml").write_text(block, encoding="utf-8")
    bench = load_bench(str(tmp_path / "motor.toml"))
    assert not lacking(bench)
    assert bench.sensors.encoder.resolution == pytest.approx(2 * math.pi / 8000)


def test_scatter_and_preload_of_the_page(tmp_path: Path) -> None:
    (block,) = blocks("toml bench")
    simulink = (SHIPPED / "benches" / "simulink.toml").read_text()
    (tmp_path / "own.toml").write_text(simulink + block)
    path = tmp_path / "my.toml"
    path.write_text("[[test]]\nname = 'one'\nkind = 'step_response'\nbench = 'own.toml'\n")
    [trial, *_] = make_plan(load_protocol(path, experiments(), shipped=SHIPPED)).trials
    variation = trial.bench["variation"]
    assert variation["day_to_day"]["load"] == {"bristle_damping": 0.05}
    assert variation["day_to_day"]["stribeck_exponent"] == 0.02
    sweep = "[test.matrix]\n'bench.variation.day_to_day.load.bristle_damping' = [0.05, 0.1]\n"
    path.write_text(path.read_text() + sweep)
    assert len(make_plan(load_protocol(path, experiments(), shipped=SHIPPED)).trials) == 2


def test_what_is_known_of_the_page(tmp_path: Path) -> None:
    (block,) = blocks("toml known")
    simulink = (SHIPPED / "benches" / "simulink.toml").read_text()
    plain = re.sub(r"\[known\]\n(?:[a-z]+ = .*\n)+", "", simulink)
    (tmp_path / "own.toml").write_text(plain + block)
    bench = load_bench(str(tmp_path / "own.toml"))
    assert bench.known_uncertainty("motor.torque_constant") == pytest.approx(0.008 / 3.919928)
    assert bench.known_uncertainty("axis.inertia") == pytest.approx(0.05 * 35)


def test_every_key_is_documented() -> None:
    keys = [*ProtocolFile.model_fields, *TestEntry.model_fields, *KnownOptions.model_fields]
    for key in keys:
        assert f"`{key}`" in PAGE or f"`[{key}]`" in PAGE or f"`[[{key}]]`" in PAGE


@pytest.mark.parametrize(
    "setting",
    [
        "title=Second try",
        "stabilization.frequency=0.5 Hz",
        "stabilization.repeat=3",
        "stabilization.bench.axis.inertia=40 kg m^2",
        "stabilization.matrix.cycles=[3, 6]",
        "rest.pause=5 min",
    ],
)
def test_settings_of_the_page(tmp_path: Path, setting: str) -> None:
    key, value = setting.split("=")
    assert f'`--set {key}="{value}"`' in PAGE or f"`--set {setting}`" in PAGE
    path = tmp_path / "my.toml"
    faults = next(block for block in blocks("toml part") if "[faults]" in block)
    path.write_text(blocks("toml")[0] + faults)
    load_protocol(path, experiments(), overrides=[setting], shipped=SHIPPED)
