"""One archived trial as pandas and xarray objects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING

from campaign.api.estimates import metrics_table
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.errors import UsageError
from campaign.recording import Ending, Recording
from campaign.trial import Trial

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True)
class TrialView:
    """One trial of a run. Every method that returns samples reads them again.

    Attributes:
        cut: selected time (start, stop) (s); None for all.
        damaged: known damage of its run. No method returns damaged samples.
    """

    archived: ArchivedTrial = field(repr=False)
    cut: tuple[float, float] | None = None
    damaged: tuple[Damage, ...] = field(default=(), repr=False)

    @property
    def number(self) -> int:
        return self.archived.trial.number

    @property
    def name(self) -> str:
        return self.archived.trial.name

    @property
    def trial(self) -> Trial:
        """Definition of the trial: test, point, options, bench, task, seed."""
        return self.archived.trial

    @property
    def ending(self) -> Ending:
        """Outcome and reason."""
        return self.archived.ending

    def window(self, start: float | None = None, stop: float | None = None) -> TrialView:
        """The same trial, cut to start <= time < stop (s); absent: the window of the analysis."""
        first, last = self.trial.task.window
        cut = (first if start is None else start, last if stop is None else stop)
        return replace(self, cut=cut)

    def recording(self) -> Recording:
        """Samples and events as NumPy arrays, SI. Raises ArchiveError when they are damaged."""
        whole = self.archived.recording()
        return whole.window(*self.cut) if self.cut else whole

    def frame(self) -> pd.DataFrame:
        """One column per channel (SI), the time (s) as index; units and labels in `attrs`."""
        import pandas as pd

        recording = self.recording()
        channels = recording.channels.values()
        frame = pd.DataFrame(
            {channel.name: channel.samples for channel in channels},
            index=pd.Index(recording.time, name="time"),
        )
        frame.attrs = {
            "trial": self.name,
            "title": self.trial.label,
            "units": {"time": "s"} | {channel.name: channel.unit for channel in channels},
            "labels": {"time": "Time"} | {channel.name: channel.label for channel in channels},
        }
        return frame

    def dataset(self) -> xr.Dataset:
        """One variable per channel (SI) over the coordinate `time` (s), with units and labels."""
        try:
            import xarray as xr
        except ImportError:
            raise UsageError(
                "dataset() needs xarray: pip install 'campaign[xarray]'; frame() does not"
            ) from None
        recording = self.recording()
        variables = {
            channel.name: ("time", channel.samples, _described(channel.unit, channel.label))
            for channel in recording.channels.values()
        }
        time = ("time", recording.time, _described("s", "Time"))
        about = {
            "trial": self.name,
            "title": self.trial.label,
            "outcome": self.ending.outcome.value,
        }
        return xr.Dataset(variables, {"time": time}, about)

    def __repr__(self) -> str:
        ended = self.ending.outcome.value + (
            f": {self.ending.reason}" if self.ending.reason else ""
        )
        cut = f", {self.cut[0]:g} s to {self.cut[1]:g} s" if self.cut else ""
        return f"<{self.name}: {self.trial.label}{cut}; {ended}>"

    def _repr_html_(self) -> str:
        """HTML for a notebook: `repr`, and the table of metrics."""
        metrics = metrics_table([self.archived]).to_html()
        return f"<p><code>{escape(repr(self))}</code></p>{metrics}"


def _described(unit: str, label: str) -> dict[str, str]:
    return {"units": unit, "long_name": label}
