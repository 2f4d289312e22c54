"""Every mistake is one clear message and the documented exit code, and leaves nothing half done."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.user import SEA, campaign, write

MISTAKES = """\
[[test]]
name = "sea"
kind = "stabilisation"
bench = "simulink"

[[test]]
name = "rate"
kind = "stabilization"
bench = "simulink"
frequency = 0.24
"""


def test_all_mistakes_of_a_protocol_are_said_at_once_by_line_and_column(tmp_path: Path):
    write(tmp_path, MISTAKES)
    for name in ("plan", "run"):
        lines = campaign(tmp_path, name, "protocol.toml", code=2).err.splitlines()
        assert lines[0].startswith("protocol.toml:3:8: ")
        assert "did you mean 'stabilization'" in lines[0]
        assert lines[1].startswith("protocol.toml:10:13: ")
        assert '"0.24 Hz"' in lines[1]
    assert [path.name for path in tmp_path.iterdir()] == ["protocol.toml"]


def test_a_plan_that_breaks_a_limit_moves_nothing(tmp_path: Path):
    write(tmp_path, SEA)
    change = 'sea.acceleration="500 deg/s^2"'
    refused = campaign(tmp_path, "run", "protocol.toml", "--set", change, code=3)
    assert "nothing was moved" in refused.err
    assert "500 deg/s^2" in refused.err
    assert not (tmp_path / "results").exists()
    planned = campaign(tmp_path, "plan", "protocol.toml", "--set", change, code=3)
    assert "BROKEN" in planned.out


@pytest.mark.slow
def test_a_measured_limit_ends_the_trial_and_the_others_go_on(tmp_path: Path):
    limit = '"bench.limits.current" = ["3.18 A", "90 A"]\n'
    write(tmp_path, SEA + limit)
    run = campaign(tmp_path, "run", "protocol.toml", code=3)
    assert "the current limit is 3.18 A" in run.err
    assert "2 trials done, 2 limit" in run.err
    shown = campaign(tmp_path, "show", run.last_line).out
    assert "status:      failed trials" in shown
    campaign(tmp_path, "report", run.last_line)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "nothing.toml"), "no such file"),
        (("run", "quickstrat"), "did you mean 'quickstart'"),
        (
            ("run", "quickstart", "--backend", "moon"),
            "there are canopen, files, import, replay, serial, sim",
        ),
        (("run", "quickstart", "--only", "nix"), "velocity-map"),
        (("run", "quickstart", "--set", "nonsense"), "--set"),
        (("run", "quickstart", "--set", "backend.longest_step=1"), "has no unit"),
        (("run", "quickstart", "--set", "backend.colour=red"), "backend.colour"),
        (("run", "quickstart", "--workers", "0"), "workers"),
        (("report", "nothing"), "results: there is no such folder"),
        (("show", "nothing"), "results: there is no such folder"),
        (("list",), "results: there is no such folder; name the one that holds"),
        (("verify", "2026", "--results", "gone"), "gone: there is no such folder"),
        (("index", "gone"), "gone: there is no such folder"),
        (("kinds", "lugr"), "did you mean 'lugre'"),
        (("frobnicate",), "frobnicate"),
        (("run",), "PROTOCOL"),
    ],
)
def test_what_is_not_there_is_bad_usage(tmp_path: Path, arguments: tuple[str, ...], message: str):
    assert message in campaign(tmp_path, *arguments, code=2).err
    assert not list(tmp_path.iterdir())


def test_results_that_cannot_be_written_are_refused_before_anything_runs(tmp_path: Path):
    write(tmp_path, SEA)
    refused = campaign(tmp_path, "run", "protocol.toml", "--results", "protocol.toml/x", code=2)
    assert "protocol.toml/x" in refused.err
    assert "done" not in refused.err


def test_a_damaged_archive_has_its_own_code_and_does_not_stall_the_list(tmp_path: Path):
    write(tmp_path, SEA)
    whole = tmp_path / campaign(tmp_path, "run", "protocol.toml").last_line
    content = whole.read_bytes()
    cut = whole.with_name("cut.nxs")
    cut.write_bytes(content[: len(content) // 2])
    whole.with_name("text.nxs").write_text("not an archive", encoding="utf-8")
    for name in ("report", "show"):
        for run in ("cut", "text"):
            assert f"{run}.nxs" in campaign(tmp_path, name, run, code=4).err
    lines = campaign(tmp_path, "list").out.splitlines()
    assert sorted(line.split("\t")[1] for line in lines[1:]) == [
        "complete",
        "unreadable",
        "unreadable",
    ]
    assert not list(tmp_path.rglob("*-report"))


def test_markup_in_a_users_text_is_shown_as_it_is(tmp_path: Path):
    write(tmp_path, SEA.replace("A short sea", "[red]sea[/nothing] :smile:"))
    assert "[red]sea[/nothing] :smile:" in campaign(tmp_path, "plan", "protocol.toml").out
