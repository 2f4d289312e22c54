"""What docs/protocols.md shows is what happens."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.protocol import ProtocolFile, TestEntry, check_limits, load_protocol, make_plan

from .conftest import SHIPPED

PAGE = (SHIPPED.parent / "docs" / "protocols.md").read_text()


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("block", "trials"), list(zip(blocks("toml"), [4, 72], strict=True)))
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


def test_every_key_is_documented() -> None:
    for key in [*ProtocolFile.model_fields, *TestEntry.model_fields]:
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
    path.write_text(blocks("toml")[0] + blocks("toml part")[0])
    load_protocol(path, experiments(), overrides=[setting], shipped=SHIPPED)
