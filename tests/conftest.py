"""Settings for the whole suite."""

from __future__ import annotations

import os

# Nothing here may need a display, and what a terminal looks like must not depend on the machine.
os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it
for name in ("FORCE_COLOR", "NO_COLOR", "COLUMNS", "CAMPAIGN_DEBUG"):
    os.environ.pop(name, None)
