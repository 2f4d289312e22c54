"""Pages for the operator: one for the hand-over, one for each attempt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from campaign.axis_kind import in_axis_terms, sides_in
from campaign.backends.handover.acceptance import GO_ON
from campaign.backends.handover.columns import can_be_recorded, requested_channels
from campaign.backends.handover.excitation import Series, shown
from campaign.backends.handover.handover_folder import (
    COLUMNS,
    MANIFEST,
    Attempt,
    Verdict,
    read_json,
)
from campaign.channels import meaning_in_sentence, unit_of
from campaign.plain_text import on_a_page
from campaign.trial import Role, Trial

_STYLE = """
body { font: 1rem/1.5 system-ui, sans-serif; max-width: 46rem; margin: 2rem auto; padding: 0 1rem;
       color: #1a1a1a; background: #fff; }
p, li, td { overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; } caption { text-align: left; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0;
         border-bottom: 1px solid #bbb; }
th, td.short { white-space: nowrap; }
code { font-family: ui-monospace, monospace; font-size: .95em; }
.refused { border-left: .4rem solid #b00020; padding: .3rem .8rem; }
.due { border-left: .4rem solid #00539f; padding: .3rem .8rem; }
svg { width: 100%; height: auto; }
@media print { body { margin: 0; max-width: none; } h2 { break-after: avoid; } }
"""
_SAFE = (
    "This program moves nothing and sees nothing of the rig: whether it is safe is in your hands. "
    "Hand in a recording only once the axis stands still with its drive off; handing in says so."
)


@dataclass(frozen=True)
class Row:
    """A trial in the list of the first page.

    Attributes:
        duration: s.
        attempts: exported attempts with their verdicts; may be empty.
    """

    name: str
    label: str
    role: str
    duration: float
    setup: tuple[str, ...]
    attempts: tuple[tuple[Attempt, Verdict | None], ...]

    @classmethod
    def of_trial(cls, trial: Trial, attempts: Sequence[Attempt]) -> Row:
        """Row of a trial of this session."""
        return cls(
            trial.name,
            trial.label,
            trial.role.value,
            trial.task.duration,
            trial.setup,
            tuple((each, each.verdict) for each in attempts),
        )

    @classmethod
    def of_manifest(cls, attempts: Sequence[Attempt]) -> Row:
        """Row of a trial of an earlier session, from its manifest."""
        tree = read_json(attempts[-1].folder / MANIFEST) or {}
        task = tree.get("task")
        duration = task.get("duration") if isinstance(task, dict) else None
        return cls(
            str(tree.get("name", "")),
            str(tree.get("label", "")),
            str(tree.get("role", "")),
            float(duration or 0.0),
            tuple(map(str, tree.get("setup", ()))),
            tuple((each, each.verdict) for each in attempts),
        )


def first_page(run: str, rows: Sequence[Row], due: str, state: str, mapping: str) -> str:
    """The page of the whole hand-over.

    Args:
        due: name of the trial whose recording is awaited; "" for none.
        state: present state of the run, a sentence.
        mapping: file that defines the columns.
    """
    body = [
        f"<h1>Hand-over of {_text(run)}</h1>" if run else "<h1>Hand-over</h1>",
        f'<p class="due" role="status">{_text(state)}</p>',
        f"<p>{_text(_SAFE)}</p>",
        "<h2>What to do</h2>",
        "<ol>",
        f"<li>Say in <code>{_text(mapping)}</code> how your files call the channels, once.</li>",
        (
            "<li>Take the trials in their order. The page of each says what to set up, what to "
            "play and what to record.</li>"
        ),
        (
            "<li>Put the recording into the trial's folder <code>returned</code>, under any name, "
            "in one file or several of one clock. Once all of it is there, put an empty file named "
            "<code>done</code> beside it. Without that mark a recording is taken when its files "
            "have not changed for a while.</li>"
        ),
        (
            "<li>It is held against what was asked. What is not that is refused by name, in the "
            "table below; whether it is asked for once more is for the protocol to say.</li>"
        ),
        "</ol>",
        "<h2>Trials</h2>",
        (
            "<table><thead><tr><th scope='col'>trial</th><th scope='col'>what</th>"
            "<th scope='col'>lasts</th><th scope='col'>state</th></tr></thead><tbody>"
        ),
        *(_row(row, due) for row in rows),
        "</tbody></table>",
    ]
    return _page(f"Hand-over of {run}", body)


def attempt_page(
    trial: Trial, attempt: Attempt, series: Sequence[Series], before: Sequence[str], mapping: str
) -> str:
    """The page of one attempt at a trial. `before`: reasons of earlier refusals, in order."""
    task = trial.task
    up = "../" * (2 if attempt.number > 1 else 1)
    again = f", attempt {attempt.number}" if attempt.number > 1 else ""
    body = [
        f"<p><a href='{up}index.html'>All trials</a></p>",
        f"<h1>{_text(trial.name)}{again}</h1>",
        f"<p>{_text(trial.label)}{_role(trial.role.value)}</p>",
    ]
    if before:
        items = "".join(f"<li>{_text(reason)}</li>" for reason in before)
        body.append(f"<div class='refused'><p>What was refused before:</p><ol>{items}</ol></div>")
    body += ["<h2>Set up</h2>", "<ol>"]
    body += [f"<li>{_text(step)}</li>" for step in trial.setup]
    body += [f"<li>{_text(line)}</li>" for line in _settings(trial)]
    body += ["</ol>"]
    body += [f"<p>{_text(trial.note)}</p>"] if trial.note else []
    body += [
        "<h2>Play</h2>",
        f"<p>{len(series[0].values)} samples at {task.sample_rate:g} Hz, {task.duration:.6g} s: "
        "<a href='excitation.csv'>excitation.csv</a>, or the same as "
        "<a href='excitation.mat'>excitation.mat</a>. Its columns are "
        + "; ".join(f"<code>{_text(each.name)}</code> in {_text(each.unit)}" for each in series)
        + f". All there is to know stands in <a href='{MANIFEST}'>{MANIFEST}</a>, in SI.</p>",
        *(_sketch(each) for each in series[1:]),
    ]
    if task.stop_rate is not None:
        rate = _text(shown(trial, "relative_rate", task.stop_rate))
        body.append(
            f"<p>It may end early: {GO_ON / task.sample_rate:.4g} s ({GO_ON} samples) after the "
            f"rate has passed {rate}, within the limits. What the load does as it breaks away is "
            "in those samples.</p>"
        )
    body += [
        "<h2>Record</h2>",
        (
            f"<p>From the first sample of the excitation to its last, at {task.sample_rate:g} Hz. "
            f"What the columns are called is said in <code>{_text(mapping)}</code>.</p>"
        ),
        _channels(trial),
        "<h2>Hand in</h2>",
        f"<p>{_text(_SAFE)}</p>",
        (
            "<p>Into <a href='returned/'><code>returned</code></a> beside this page; at last an "
            "empty file named <code>done</code>.</p>"
        ),
    ]
    return _page(f"{trial.name}{again}", body)


def columns_file(path: Path, folder: Path) -> str:
    """Layout file as shown on the pages: by its name if it is in the folder."""
    return COLUMNS if path == folder / COLUMNS else str(path)


def manifest(
    trial: Trial, attempt: Attempt, run: str, series: Sequence[Series], before: Sequence[str]
) -> dict[str, Any]:
    """All data of a trial for the rig, in SI."""
    task = trial.task
    methods = trial.bench.get("compensation")
    method = methods.get(task.compensation) if isinstance(methods, dict) else None
    return {
        "handover": 1,
        "run": run,
        "trial": trial.number,
        "name": trial.name,
        "attempt": attempt.number,
        "fingerprint": trial.fingerprint,
        "test": trial.test,
        "experiment": trial.kind,
        "role": trial.role.value,
        "label": trial.label,
        "note": trial.note,
        "setup": list(trial.setup),
        "task": task.model_dump(mode="json"),
        "samples": len(series[0].values),
        "columns": [{"name": each.name, "unit": each.unit} for each in series],
        "windows": [
            {"name": window.name, "start": window.start, "stop": window.stop}
            for window in trial.windows
        ],
        "record_after_stop_rate": GO_ON / task.sample_rate if task.stop_rate else 0.0,
        "limits": trial.bench.get("limits"),
        "controller": trial.bench.get("controller"),
        "compensation": {"method": task.compensation, "parameters": method},
        "requires": [_channel(trial, name) for name in trial.requires],
        "can_use": [_channel(trial, name) for name in trial.can_use],
        "seed": trial.seed,
        "refused_before": list(before),
    }


def _channel(trial: Trial, name: str) -> dict[str, str]:
    return {"name": name, "unit": _unit(trial, name)}


def _unit(trial: Trial, name: str) -> str:
    return unit_of(name, trial.task.mode, sides_in(trial.bench))


def _row(row: Row, due: str) -> str:
    name = _text(row.name)
    if row.attempts:
        folder = row.attempts[-1][0].folder
        within = folder.name if folder.name == row.name else f"{row.name}/{folder.name}"
        name = f"<a href='{within}/index.html'>{name}</a>"
    steps = "".join(f"<br>{_text(step)}" for step in row.setup)
    states = [_state(attempt, verdict) for attempt, verdict in row.attempts]
    if row.name == due:
        states[-1] = f"<strong>{states[-1]}, waited for</strong>"
    state_text = "<br>".join(states) or "to come"
    return (
        f"<tr><th scope='row'>{name}</th><td>{_text(row.label)}{_role(row.role)}{steps}</td>"
        f"<td class='short'>{row.duration:.4g} s</td><td>{state_text}</td></tr>"
    )


def _state(attempt: Attempt, verdict: Verdict | None) -> str:
    if verdict is None:
        return "handed out" if attempt.number == 1 else f"attempt {attempt.number} handed out"
    if not verdict.reason:
        return "taken"
    return f"attempt {attempt.number} refused: {_text(verdict.reason)}"


def _role(role: str) -> str:
    texts: dict[str, str] = {
        Role.HOME: "; it brings the axis to where the next trial begins",
        Role.WARM_UP: "; it warms the bench up",
        Role.CHECK: "; it shows whether the bench is still the same",
    }
    return texts.get(role, "")


def _settings(trial: Trial) -> list[str]:
    task, sides = trial.task, sides_in(trial.bench)
    angle = shown(trial, "relative_angle", task.start_angle)
    rest = "the hull at rest" if task.base_acceleration.shape == "zero" else "the hull as played"
    loop = {
        "rate": "Close the rate loop: the command is the rate of the load.",
        "torque": "Open the rate loop: the command is the drive's torque at the load.",
    }.get(task.mode, f"Mode {task.mode}.")
    lines = [f"Begin at {angle}, at rest; {rest}.", in_axis_terms(loop, sides)]
    method = task.compensation
    lines.append(
        "No friction compensation."
        if method == "none"
        else f"Friction compensation {method!r}, with the parameters of the manifest."
    )
    limits = trial.bench.get("limits")
    if isinstance(limits, dict):
        watched = {
            "angle": "relative_angle",
            "rate": "relative_rate",
            "torque": "drive_torque",
            "current": "motor_current",
        }
        shown_limits = [
            f"{in_axis_terms(name, sides)} {shown(trial, watched[name], float(value))}"
            for name, value in limits.items()
            if name in watched and isinstance(value, int | float)
        ]
        lines.append(f"Limits that the rig itself has to keep: {', '.join(shown_limits)}.")
    return lines


def _channels(trial: Trial) -> str:
    needed, useful = requested_channels([trial])
    rows = [
        f"<tr><th scope='row'><code>{_text(name)}</code></th>"
        f"<td class='short'>{_text(_unit(trial, name))}</td>"
        f"<td class='short'>{need}</td><td>{_text(meaning_in_sentence(name))}</td></tr>"
        for names, need in ((needed, "needed"), (useful, "of use"))
        for name in names
        if can_be_recorded(name)
    ]
    head = "".join(f"<th scope='col'>{word}</th>" for word in ("channel", "SI unit", "", "what"))
    return (
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
        "<p>A channel that follows from another need not be recorded: the drive torque from the "
        "motor current, the rate from the angle. Any unit will do that the layout names.</p>"
    )


def _sketch(series: Series) -> str:
    """Figure of the series as a line of at most 600 points, as a preview."""
    values = series.values
    places = np.unique(np.linspace(0, len(values) - 1, 600).astype(int))
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    span = (high - low) or 1.0
    points = " ".join(
        f"{600 * k / max(1, len(values) - 1):.1f},{110 - 100 * (values[k] - low) / span:.1f}"
        for k in places
    )
    zero = 110 + 100 * low / span
    label = f"{series.name}, {low:.4g} to {high:.4g} {series.unit}"
    return (
        f"<figure><svg viewBox='0 0 600 120' role='img' aria-label='{_text(label)}'>"
        f"<line x1='0' x2='600' y1='{zero:.1f}' y2='{zero:.1f}' stroke='#999'/>"
        f"<polyline fill='none' stroke='#00539f' stroke-width='1.5' points='{points}'/></svg>"
        f"<figcaption>{_text(label)}</figcaption></figure>"
    )


def _page(title: str, body: Sequence[str]) -> str:
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{_text(title)}</title><style>{_STYLE}</style></head><body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _text(text: str) -> str:
    return escape(on_a_page(text), quote=True)
