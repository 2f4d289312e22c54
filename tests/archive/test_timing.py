"""What a writer is busy with is told: each file and line of a trial, and each copy of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import SimBackend, SimOptions
from campaign.stopwatch import Timing, Work
from tests.archives import plan_of

NOW = "2026-01-01T00:00:00Z"


class Heard(Timing):
    """Remembers which spans began; each block of the engine is one."""

    def __init__(self) -> None:
        self.works: list[Work] = []

    @contextmanager
    def span(self, work: Work) -> Iterator[None]:
        self.works.append(work)
        yield

    def each(self, work, items):
        for item in items:
            self.works.append(work)
            yield item

    def since(self) -> list[Work]:
        works, self.works = self.works, []
        return works


def test_writing_a_trial_and_sealing_are_told_as_what_they_are(tmp_path: Path) -> None:
    trial = plan_of(tmp_path).trials[0]
    heard, backend = Heard(), SimBackend(SimOptions())
    writer = RunWriter.create(tmp_path / "results", RunHeader(name="r", created=NOW), [trial])
    writer.timing = backend.timing = heard
    recorder = writer.begin(trial)
    assert heard.since() == [Work.TRIAL_FILES]
    ending = backend.execute(trial, recorder, lambda: False)
    assert {*heard.since()} == {Work.SETTING_UP, Work.ENGINE, Work.TRIAL_FILES}
    recorder.finish(ending, NOW, NOW)
    assert heard.since() == [Work.TRIAL_FILES]
    assert writer.seal_next()
    assert heard.since() == [Work.SEALING]
    writer.seal(RunStatus.COMPLETE, "", ended=NOW)
    assert heard.since() == [Work.SEALING]
