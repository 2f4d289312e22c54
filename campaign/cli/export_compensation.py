"""`campaign export-compensation`: a compensation of a bench as controller code."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from campaign import __version__
from campaign.cli.check import CheckedLoop, loops_checked
from campaign.cli.output import print_line, print_note
from campaign.controller_code.c_code import SINGLE, c_code, vectors_code
from campaign.controller_code.compensation import INPUTS, Sampled
from campaign.errors import UsageError
from campaign.physics.bench_knowledge import KnownValue
from campaign.physics.complete import CompleteBench
from campaign.protocol.bench_file import bench_source, simulable
from campaign.protocol.loop_check import margins_in_words
from campaign.text import number

Array = NDArray[np.float64]
SAMPLES = 2_000
"""of the test vectors."""
FREQUENCIES = 0.3, 1.7, 6.1
"""Hz, of the sines that they move along."""


def export_compensation(bench: str, name: str, target: str, output: Path) -> list[Path]:
    """Write code, and a test of it with inputs and torques of this program, into `output`.

    Raises UsageError: no such bench, compensation or target; a bench that is not sampled; a model
    whose step function has no counterpart in the target's language.
    """
    targets: dict[str, Callable[[Sampled, list[str]], dict[str, str]]] = {
        "c": _c,
        "c-single": _c_single,
        "json": _json,
    }
    if target not in targets:
        raise UsageError(f"--to {target}: there are {', '.join(targets)}")
    made = Sampled.of(simulable(bench), name)
    head = list(_head(bench, made))
    texts = targets[target](made, head)
    try:
        output.mkdir(parents=True, exist_ok=True)
        for file, text in texts.items():
            (output / file).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise UsageError(f"--output {output}: cannot be written: {error.strerror}") from None
    for line in head:
        print_line(line)
    low = [each.verdict for each in _loops(made.bench, name) if each.verdict != "fine"]
    if low:
        print_note(
            f"of its loops {len(low)} are not fine: {', '.join(dict.fromkeys(low))}", "yellow"
        )
    return [output / file for file in texts]


def vectors(made: Sampled) -> Array:
    """`INPUTS` along three sines with noise of the sensors' size, shape (n, 4): always the same."""
    draw, limits = np.random.default_rng(1), made.bench.limits
    time = np.arange(SAMPLES) * float(made.controller.period[0])
    angle, rate = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for frequency in FREQUENCIES:
        turned = 2.0 * np.pi * frequency
        size = 0.05 * limits.rate / turned
        angle += size * np.sin(turned * time)
        rate += size * turned * np.cos(turned * time)
    twist = 1e-4 * limits.angle * draw.standard_normal(SAMPLES)
    current = 0.2 * limits.current * np.sin(2.0 * np.pi * 0.9 * time)
    noise = 1e-4 * limits.rate * draw.standard_normal(SAMPLES)
    return np.column_stack([rate + noise, angle, angle + twist, current])


def _c(made: Sampled, head: list[str], *, single: bool = False) -> dict[str, str]:
    name = made.identifier
    return {
        f"{name}.c": c_code(made, head, single=single),
        f"{name}_test.c": vectors_code(made, vectors(made), single=single),
    }


def _c_single(made: Sampled, head: list[str]) -> dict[str, str]:
    told = f"In single precision: to {SINGLE:g} of the largest torque of the test vectors."
    return _c(made, [*head, told], single=True)


def _json(made: Sampled, head: list[str]) -> dict[str, str]:
    """The numbers alone, for whoever writes the code."""
    its, inputs = made.controller, vectors(made)
    tree = {
        "about": head,
        "period_s": float(its.period[0]),
        "filter_pole": float(its.filter_pole[0]),
        "torque_per_current": float(its.torque_per_current[0]),
        "rate_of": "load_angle" if its.fed_by_encoder else "gyro_rate",
        "torque_limit": made.bench.limits.torque,
        "linear": {each: getattr(its, each)[..., 0].tolist() for each in "abcd"},
        "options": made.bench.compensation[made.name].model_dump(mode="json"),
        "friction": [
            {
                "rate": each.rate,
                "torque": each.torque,
                "viscous": each.viscous,
                "angle": "motor" if motor else "load",
                "ripple": each.ripple,
                "parameters": each.parameters.tolist(),
            }
            for each, motor in zip(made.interfaces, made.motor_side, strict=True)
        ],
        "inputs": INPUTS,
        "vectors": np.column_stack([inputs, made.torques(inputs)]).tolist(),
    }
    text = json.dumps(tree, indent=1, ensure_ascii=False) + "\n"
    return {f"{made.identifier}.json": text}


def _head(bench: str, made: Sampled) -> Iterator[str]:
    """Where each number comes from, and what the loop is worth with it."""
    source = bench_source(bench)
    its = made.bench
    yield f"The compensation '{made.name}' of the bench '{its.name}', by campaign {__version__}."
    yield f"Bench file: {bench}, SHA-256 {hashlib.sha256(source.text.encode()).hexdigest()[:16]}"
    yield f"Sampled every {number(1e3 * float(made.controller.period[0]), 4)} ms; SI units."
    if (run := its.known.identified) is not None:
        yield f"Values that are measured: from {run.run}, digest {run.digest[:16]}"
    for path, value in _leaves(its.compensation[made.name]):
        known = its.known.values.get(f"compensation.{made.name}.{path}")
        yield f"{path} = {value}" + ("" if known is None else f" ({_uncertainty(known)})")
    for each in _loops(its, made.name):
        told = each.verdict if each.margins is None else margins_in_words(each.margins)
        yield f"Loop, {each.regime}, {each.mode} command: {told}"
    yield "Not in it: delays and resolutions of sensors; the rate loop."


def _uncertainty(known: KnownValue) -> str:
    """Interval or standard deviation (SI), and the origin."""
    if known.interval is not None:
        low, high = (number(float(end), 6) for end in known.interval)
        return f"95 %: {low} to {high}; {known.origin}"
    deviation = known.standard_deviation
    return known.origin if deviation is None else f"± {number(deviation, 3)}, 1σ; {known.origin}"


def _loops(bench: CompleteBench, name: str) -> list[CheckedLoop]:
    return [each for each in loops_checked(bench) if each.compensation == name]


def _leaves(options: BaseModel) -> Iterator[tuple[str, object]]:
    def walk(tree: object, path: str) -> Iterator[tuple[str, object]]:
        if isinstance(tree, dict):
            for key, value in tree.items():
                yield from walk(value, f"{path}.{key}" if path else str(key))
        elif tree is not None and tree not in ([], ()):
            yield path, tree

    yield from walk(options.model_dump(mode="json", exclude_defaults=True), "")
