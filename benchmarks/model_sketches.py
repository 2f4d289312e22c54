"""The sketches of the documentation: contacts of friction models, and the loop with compensation.

Run with `python -m benchmarks.model_sketches`. It writes docs/images/sketch-*.svg; the loop is
that of Figures 5.3 and 5.16 of the thesis, in symbols of docs/developers/physics.md.
"""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from benchmarks.document import IMAGES

INK, SOFT, LINE = "#1c1f23", "#e8edf3", 1.0
STYLE = {"svg.fonttype": "none", "svg.hashsalt": "sketch", "font.size": 8, "mathtext.default": "it"}


class Sketch:
    """Axes without a frame, and what is drawn in them."""

    def __init__(self, axes: Any, width: float, height: float, title: str = "") -> None:
        self.axes = axes
        axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
        axes.axis("off")
        axes.set_title(title, fontsize=8, color=INK)

    def line(self, *points: tuple[float, float], arrow: bool = False, style: str = "-") -> None:
        x, y = zip(*points, strict=True)
        self.axes.plot(x, y, style, color=INK, lw=LINE, solid_capstyle="round")
        if arrow:
            ends = {"xy": points[-1], "xytext": points[-2]}
            look = {"arrowstyle": "-|>", "color": INK, "lw": LINE, "shrinkA": 0, "shrinkB": 0}
            self.axes.annotate("", **ends, arrowprops=look)

    def text(self, x: float, y: float, text: str, **how: Any) -> None:
        self.axes.text(x, y, text, **{"ha": "center", "va": "center", "color": INK, **how})

    def box(self, x: float, y: float, width: float, height: float, text: str = "") -> None:
        """Around a center."""
        corner = (x - width / 2, y - height / 2)
        self.axes.add_patch(Rectangle(corner, width, height, fc=SOFT, ec=INK, lw=LINE, zorder=2))
        self.text(x, y, text, zorder=3)

    def ground(self, left: float, right: float, y: float) -> None:
        """A fixed surface."""
        self.line((left, y), (right, y))
        for x in np.arange(left, right, 0.3):
            self.line((x, y - 0.22), (x + 0.2, y))

    def spring(self, left: float, right: float, y: float, label: str = "") -> None:
        turns = np.linspace(left + 0.3, right - 0.3, 12)
        high = 0.16 * np.where(np.arange(12) % 2, 1.0, -1.0)
        middle = zip(turns, y + np.r_[0.0, high[1:-1], 0.0], strict=True)
        self.line((left, y), *middle, (right, y))
        self.text((left + right) / 2, y + 0.42, label)

    def sum(self, x: float, y: float, *signs: tuple[float, float, str]) -> None:
        """A sum, and the sign of what comes from a side."""
        self.axes.plot(x, y, "o", ms=11, mfc="white", mec=INK, mew=LINE, zorder=2)
        for dx, dy, sign in signs:
            self.text(x + dx, y + dy, sign)


def contacts() -> Figure:
    """Bristles, Maxwell-slip elements, and a load pulled through a spring."""
    figure = Figure(figsize=(7.1, 1.9), facecolor="white", layout="constrained")
    bristles, slips, rig = (
        Sketch(axes, 6.4, 4.2, title)
        for axes, title in zip(
            figure.subplots(1, 3),
            ("Bristles (lugre)", "Maxwell-slip elements (gms)", "stick_slip"),
            strict=True,
        )
    )
    bristles.box(3.2, 3.1, 4.8, 0.8)
    bristles.line((4.3, 3.1), (6.1, 3.1), arrow=True)
    bristles.text(5.95, 3.45, "$v$")
    bristles.ground(0.4, 6.0, 0.7)
    for x in (1.2, 2.2, 3.2, 4.2, 5.2):
        bent = np.linspace(0.0, 1.0, 12)
        bristles.line(*zip(x - 0.6 + 0.6 * bent**2, 0.7 + 2.0 * bent, strict=True))
    bristles.line((2.6, 0.7), (2.6, 2.7), style=":")
    bristles.line((2.6, 2.5), (3.1, 2.5), arrow=True)
    bristles.text(2.35, 2.4, "$z$")
    bristles.text(3.2, 0.15, r"$T = \sigma_0 z + \sigma_1 dz/dt + \sigma_2 v$")

    slips.line((0.9, 1.0), (0.9, 3.6))
    slips.line((0.2, 2.3), (0.9, 2.3), arrow=True)
    slips.text(0.3, 2.65, "$q$")
    for y, which in ((3.1, "1"), (1.3, "N")):
        slips.spring(0.9, 3.2, y, f"$k_{which}$")
        slips.box(3.7, y, 1.0, 0.5)
        slips.ground(2.9, 4.6, y - 0.25)
        slips.text(5.5, y, rf"$\alpha_{which} s(v)$")
    slips.text(3.2, 2.1, "⋮")

    rig.ground(0.2, 6.2, 1.2)
    rig.box(1.4, 1.75, 1.6, 1.1, "$J$")
    rig.spring(2.2, 4.8, 1.75, "$k$")
    rig.line((4.8, 1.75), (6.2, 1.75), arrow=True)
    rig.text(5.5, 2.15, "pull rate")
    rig.line((2.1, 0.75), (0.9, 0.75), arrow=True)
    rig.text(1.5, 0.4, "$T$")
    return figure


def loop() -> Figure:
    """Rate and current loop, friction, and both compensations."""
    figure = Figure(figsize=(7.1, 2.9), facecolor="white", layout="constrained")
    s = Sketch(figure.subplots(), 17.6, 7.2)
    y, low, high = 4.6, 2.6, 6.6
    s.text(0.2, y, "$r$")
    s.line((0.4, y), (1.15, y), arrow=True)
    s.sum(1.4, y, (-0.5, 0.28, "+"), (0.28, -0.5, "–"))
    s.line((1.65, y), (2.3, y), arrow=True)
    s.box(3.1, y, 1.6, 0.9, "rate PI")
    s.line((3.9, y), (4.65, y), arrow=True)
    s.sum(4.9, y, (-0.5, 0.28, "+"), (0.28, -0.5, "+"))
    s.line((5.15, y), (6.1, y), arrow=True)
    s.text(5.6, y + 0.3, "$i^*$")
    s.box(7.2, y, 2.2, 0.9, "current loop")
    s.line((8.3, y), (9.2, y), arrow=True)
    s.text(8.75, y + 0.3, "$i$")
    s.box(9.9, y, 1.4, 0.9, "$N K_t$")
    s.line((10.6, y), (11.55, y), arrow=True)
    s.sum(11.8, y, (-0.5, 0.28, "+"), (0.28, 0.5, "–"))
    s.line((12.05, y), (12.8, y), arrow=True)
    s.box(13.5, y, 1.4, 0.9, "$1 / J s$")
    s.line((14.2, y), (17.2, y), arrow=True)
    s.text(17.4, y, r"$\omega$")
    # The hull, and friction of the relative rate.
    s.line((15.6, y), (15.6, high - 0.3), arrow=True)
    s.sum(15.6, high, (-0.28, -0.5, "+"), (0.5, 0.28, "–"))
    s.line((17.2, high), (15.85, high), arrow=True)
    s.text(17.45, high, r"$\omega_b$")
    s.line((15.35, high), (14.6, high), arrow=True)
    s.text(15.0, high + 0.3, "$v$")
    s.box(13.7, high, 1.8, 0.9, "friction")
    s.line((12.8, high), (11.8, high), (11.8, y + 0.25), arrow=True)
    s.text(11.25, high - 0.3, r"$T + \sigma_2 v$", ha="right")
    # Compensation by a model, from the relative rate; by an observer, from torque and rate.
    s.line((15.1, high), (15.1, low), (9.3, low), arrow=True)
    s.box(8.2, low, 2.2, 0.9, "friction model")
    s.line((10.95, y), (10.95, 1.55), (9.3, 1.55), arrow=True)
    s.line((16.6, y), (16.6, 1.05), (9.3, 1.05), arrow=True)
    s.box(8.2, 1.3, 2.2, 0.9, "observer")
    s.line((7.1, 1.3), (6.5, 1.3), (6.5, low))
    s.line((7.1, low), (4.9, low), (4.9, y - 0.25), arrow=True)
    s.text(6.2, 1.9, "or")
    s.text(5.7, low + 0.35, "$T_c / N K_t$")
    s.line((16.6, 1.05), (16.6, 0.3), (1.4, 0.3), (1.4, y - 0.25), arrow=True)
    s.text(2.3, 0.6, "gyro")
    for branch in ((15.6, y), (15.1, high), (10.95, y), (16.6, y), (16.6, 1.05)):
        s.axes.plot(*branch, "o", ms=3, color=INK)
    return figure


def main() -> None:
    """Write the pictures."""
    with mpl.rc_context(STYLE):
        for name, figure in (("contacts", contacts()), ("loop", loop())):
            figure.savefig(IMAGES / f"sketch-{name}.svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
