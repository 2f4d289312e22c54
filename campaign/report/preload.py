"""Imports shared by analysis and drawing processes, made while a run opens.

No other module imports this one. It imports every experiment of the program, and draws a figure,
because the first drawing of a process searches for fonts.
"""

from __future__ import annotations

import numpy as np
import scipy.stats  # noqa: F401

import campaign.report.processes  # noqa: F401
from campaign.experiments import experiments
from campaign.report.drawing.figures import draw
from campaign.result import Axis, Curve, Figure, Panel

for _name in experiments():
    if experiments().plug_in(_name) is None:  # a plug-in may have side effects
        experiments()[_name]

_LINE = Curve(np.arange(2.0), np.arange(2.0))
_PANEL = Panel(Axis("x"), Axis("y"), (_LINE,), "Title")
draw(Figure("line", "Line", "A line.", "A line.", (_PANEL,)))
