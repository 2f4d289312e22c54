"""Check of a backend that executes several trials at once."""

from __future__ import annotations

from campaign.backends.interface import Backend, ExecutesTogether
from campaign.recording import Outcome, Recording
from campaign.testing.backend_under_test import BackendUnderTest, require
from campaign.testing.strict_recorder import StrictRecorder
from campaign.trial import Trial


def executes_together_what_it_does_alone(under_test: BackendUnderTest) -> None:
    """Of trials executed together each has the samples that it has alone, and its own end."""
    with under_test.open() as backend:
        if not isinstance(backend, ExecutesTogether):
            return
        trial = under_test.possible
        fewest, most = backend.fewest_together, backend.most_together
        require(1 < fewest <= most, f"{fewest} to {most} trials together: there is no such number")
        require(
            backend.group(trial) == backend.group(trial.model_copy(update={"number": 2})),
            "group() of two trials that differ in their number only is not the same",
        )
        # Each has noise of its own. The second one is stopped at once: that is its own affair.
        trials = [
            trial.model_copy(update={"number": number, "seed": trial.seed + number})
            for number in range(1, most + 1)
        ]
        alone = [_alone(backend, each) for each in trials]
        recorders = [StrictRecorder() for _ in trials]
        stops = [lambda place=place: place == 1 for place in range(most)]
        endings = list(backend.execute_together(trials, recorders, stops))
    places = sorted(place for place, _ in endings)
    require(places == list(range(most)), f"{most} trials, and the places of endings {places}")
    for place, ending in endings:
        if place == 1:
            stopped = ending.outcome is Outcome.INTERRUPTED
            require(stopped, f"a trial that was stopped ended as {ending.outcome}")
            continue
        whole = ending.outcome is Outcome.COMPLETED
        require(whole, f"beside a trial that was stopped, another one ended as {ending.outcome}")
        require(not recorders[place].order, "; ".join(recorders[place].order))
        _require_equal(alone[place], recorders[place].recording(ending))


def _alone(backend: Backend, trial: Trial) -> Recording:
    recorder = StrictRecorder()
    return recorder.recording(backend.execute(trial, recorder, lambda: False))


def _require_equal(alone: Recording, together: Recording) -> None:
    lengths = f"{len(together.time)} samples together, {len(alone.time)} alone"
    require(len(alone.time) == len(together.time), lengths)
    for name, channel in alone.channels.items():
        equal = channel.samples.tobytes() == together[name].tobytes()
        require(equal, f"{name}: its samples are not those of the trial alone")
