"""Trials with the same random draws, and simulated numbers without an interval."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.cli import compare as command
from campaign.comparison.draws import common_draws
from campaign.comparison.finding_pairs import Pair, pairs_of
from campaign.comparison.same_quantity import pair_tests
from campaign.comparison.tables import bare_differing, change_of
from campaign.physics.bench import Bench
from campaign.references.verdict import with_verdicts
from campaign.result import Finding
from tests.comparison.test_judging import made_up


def reseeded(test: AnalysedTest, seeds: list[int], **more: Any) -> AnalysedTest:
    trials = tuple(
        replace(each, trial=each.trial.model_copy(update={"seed": seed, **more}))
        for each, seed in zip(test.trials, seeds, strict=True)
    )
    return replace(test, trials=trials)


def said(one: AnalysedTest, other: AnalysedTest) -> list[str]:
    return list(common_draws(pair_tests([one], [other])))


def test_identical_trials_and_common_seeds_are_said(platform: Bench):
    one = reseeded(made_up([], [{}, {}, {}], platform), [1, 2, 3])
    (told,) = said(one, one)
    assert told == "3 of 3 trials are identical, to the seed: equal numbers say nothing."
    (told,) = said(one, reseeded(one, [1, 5, 6]))
    assert told.startswith("1 of 3 trials are identical")
    bench = {**one.trials[0].trial.bench, "title": "another"}
    (told,) = said(one, reseeded(one, [1, 2, 9], bench=bench))
    assert told.startswith("2 of 3 trials have the seed in common")
    assert "judged as independent runs. As far as the draws act alike in both" in told
    assert "Another seed in one of the protocols makes them independent" in told
    mixed = reseeded(one, [1, 2, 9])
    last = mixed.trials[1]
    changed = replace(last, trial=last.trial.model_copy(update={"bench": bench}))
    both = said(one, replace(mixed, trials=(mixed.trials[0], changed, mixed.trials[2])))
    assert [each.partition(",")[0] for each in both] == [
        "1 of 3 trials are identical",
        "1 of 3 trials have the seed in common",
    ]
    assert said(one, reseeded(one, [4, 5, 6])) == []


def test_a_rig_never_repeats_its_samples(platform: Bench):
    test = replace(made_up([], [{}], platform), source="hardware")
    assert said(test, test) == []


def compared(source: str, bench: Bench) -> tuple[Pair, ...]:
    def run(values: list[float]) -> AnalysedTest:
        found = [Finding("torque", v, "N m", {"position": float(n)}) for n, v in enumerate(values)]
        return replace(made_up(found, [{}], bench), source=source)

    tests = pair_tests([run([10.0, 20.0])], [run([10.05, 20.0])]).tests
    return with_verdicts(list(pairs_of(tests[0])))


def test_simulated_numbers_without_an_interval_are_listed_where_they_differ(platform: Bench):
    found = [pair for pair in compared("simulation", platform) if pair.simulated_bare]
    assert len(found) == 2
    against: Any = SimpleNamespace(without_interval=found)
    (pair,) = bare_differing(against)
    assert change_of(pair).startswith("+0.5")
    assert not any(pair.simulated_bare for pair in compared("hardware", platform))


def test_the_terminal_says_what_differs_in_the_bench_behind_the_verdict(
    results: Path, tmp_path: Path, monkeypatch, capsys
):
    monkeypatch.setattr(command, "write_comparison", lambda found, output, *_: output)
    command.compare_archives(("before", "after"), results, tmp_path, ())
    out = capsys.readouterr().out
    change = "map: bench: friction.load.coulomb_torque: 16.12 N·m -> 17.732 N·m"
    assert out.index("numbers are found in both runs") < out.index(change) < out.index("finding\t")
