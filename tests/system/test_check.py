"""`campaign check`: tables, picture and exit codes, as somebody new to a bench meets them."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from campaign.cli.check import check_bench
from campaign.cli.plan import show_plan
from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode, LimitError, ProtocolError, UsageError
from campaign.resources import protocols_folder

PLATFORM = protocols_folder() / "benches" / "platform.toml"
GAIN = "198.913"
"""The proportional gain of the platform's rate loop."""


def too_fast(folder: Path) -> Path:
    """The platform with its gain in A s/rad typed as if it were in A s/deg."""
    path = folder / "wrong.toml"
    text = PLATFORM.read_text().replace(f'"{GAIN} A s/rad"', f'"{GAIN} A s/deg"')
    path.write_text(text)
    return path


@pytest.mark.slow
def test_every_loop_and_every_fact_of_a_shipped_bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert check_bench("platform", None, as_json=False) is ExitCode.DONE
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert sum(line.startswith("rate\t") for line in lines) == 8
    assert sum(line.startswith("torque\t") for line in lines) == 6
    assert "static friction against the torque limit" in out
    assert lines[-1] == "Bode picture: platform-check.svg"
    picture = ET.parse(tmp_path / "platform-check.svg").getroot()
    texts = {element.text for element in picture.iter() if element.text}
    assert {"Magnitude of L (dB)", "Phase of L (°)", "Frequency (Hz)", "observer"} <= texts


@pytest.mark.slow
def test_json_has_the_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same gain margin that a swept sine finds on the bench: 30.86 dB at 200 Hz."""
    picture = tmp_path / "p.png"
    assert check_bench("platform", picture, as_json=True) is ExitCode.DONE
    tree = json.loads(capsys.readouterr().out)
    loop = next(one for one in tree["loops"] if one["regime"] == "sliding")
    assert loop["compensation"] == "none"
    assert loop["gain_margin"] == pytest.approx(10 ** (30.86 / 20), rel=0.02)
    assert loop["gain_crossing_rad_s"] == pytest.approx(2 * 3.14159 * 200, rel=0.02)
    assert {fact["verdict"] for fact in tree["facts"]} <= {"fine", "coarse", "too coarse"}
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_an_unstable_bench_has_exit_code_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(too_fast(tmp_path))
    assert check_bench(path, tmp_path / "p.svg", as_json=False) is ExitCode.LIMIT_OR_FAULT
    shown = capsys.readouterr()
    assert "UNSTABLE" in shown.out
    assert shown.err.startswith("unstable: none, stuck, under a rate command, and ")
    assert "UNSTABLE" in (tmp_path / "p.svg").read_text()


def test_a_bad_file_is_told_by_line(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(PLATFORM.read_text().replace('inertia = "1.3 kg m^2"', 'inertia = "1.3 kg"'))
    with pytest.raises(ProtocolError, match=r"bad\.toml:\d+:\d+"):
        check_bench(str(path), None, as_json=False)
    with pytest.raises(UsageError, match="no shipped bench"):
        check_bench("platfrom", None, as_json=False)
    with pytest.raises(UsageError, match=r"\.svg or \.png"):
        check_bench("platform", tmp_path / "p.pdf", as_json=False)
    with pytest.raises(UsageError, match="cannot be written"):
        check_bench("platform", tmp_path / "no" / "p.svg", as_json=False)


def with_gain(gain: str) -> Request:
    change = f'stabilization-hardware.bench.controller.rate.proportional="{gain}"'
    return Request("stabilization_hardware", changes=(change,))


def test_plan_and_run_refuse_an_unstable_loop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    request = with_gain(f"{GAIN} A s/deg")
    with pytest.raises(LimitError, match="A s/deg given as A s/rad"):
        show_plan(request, tmp_path / "results", as_json=False)
    assert "loop: UNSTABLE" in capsys.readouterr().out  # it is shown all the same
    with pytest.raises(LimitError, match="the loop is unstable in 1 test"):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert not (tmp_path / "results").exists()


def test_plan_tells_the_worst_loop_and_warns_of_a_low_margin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    show_plan(with_gain(f"{GAIN} A s/rad"), tmp_path, as_json=False)
    fine = capsys.readouterr()
    assert "  loop: 5.82 Hz crossover, 68.9 deg, 31 dB (observer, sliding)" in fine.out
    assert "low margin" not in fine.err
    show_plan(with_gain("5300 A s/rad"), tmp_path, as_json=True)
    low = capsys.readouterr()
    assert json.loads(low.out)["tests"][0]["loops"][0]["low_margin"] is True
    assert "\nlow margin: stabilization-hardware: " in low.err


def test_a_protocol_in_place_of_a_bench_and_the_other_way_round_are_told_in_one_line(
    tmp_path: Path,
) -> None:
    protocol = PLATFORM.parent.parent / "quickstart.toml"
    with pytest.raises(ProtocolError) as met:
        check_bench(str(protocol), None, as_json=False)
    assert [each.message for each in met.value.problems] == [
        "this is a protocol, and a bench is asked for; `campaign plan` takes protocols"
    ]
    bench = tmp_path / "rig.toml"
    bench.write_text("schema = 3\n" + PLATFORM.read_text())  # newer than any of a protocol
    with pytest.raises(ProtocolError) as met:
        show_plan(Request(str(bench)), tmp_path, as_json=False)
    assert [each.message for each in met.value.problems] == [
        "this is a bench, and a protocol is asked for; `campaign check` takes benches"
    ]
