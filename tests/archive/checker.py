"""Imported in place of a command: the checker of the NeXus community that `CHECKER` names."""

from __future__ import annotations

import importlib
import os
import sys

sys.exit(importlib.import_module(f"nexusformat.scripts.{os.environ['CHECKER']}").main())
