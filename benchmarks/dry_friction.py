"""How the error of dry friction falls with the step.

Run with `python -m benchmarks.dry_friction`. The engine beside the event-switched reference of
the tests: the thesis' loop, then ten benches drawn at random. Columns are steps; rows the relative
error of the stabilization error, and of outputs over time, rms over rms (of the friction torque
the median).
"""

from __future__ import annotations

from tests.physics.dry_cases import drawn, errors, steep_rise, thesis

STEPS = (2e-3, 1e-3, 0.5e-3, 0.25e-3, 0.1e-3)
CASES = [
    thesis(),
    thesis("static"),
    thesis("lugre"),
    thesis("lugre", low_pass=1e-3),
    thesis("observer"),
    thesis("static", bristles=True),
    thesis("lugre", bristles=True),
    steep_rise(),
    *(drawn(seed) for seed in range(10)),
]


def main() -> None:
    print(f"{'':32}" + "".join(f"{step * 1e3:>9g} ms" for step in STEPS))
    for case in CASES:
        print(case.name)
        expected = case.expected()
        rows = [errors(case, expected, step) for step in STEPS]
        for name in rows[0]:
            print(f"    {name:28}" + "".join(f"{row[name]:12.1e}" for row in rows))


if __name__ == "__main__":
    main()
