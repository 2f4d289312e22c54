"""`campaign index`: one page over all runs of a results folder."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from campaign.cli.output import print_note
from campaign.interrupts import unwinding
from campaign.report.index.page import write_index
from campaign.resources import templates_folder


@unwinding()
def index_results(results: Path, *, open_it: bool) -> Path:
    """Write the page and return its path."""
    page = write_index(results, templates_folder())
    if open_it and not webbrowser.open(page.resolve().as_uri()):
        print_note("no browser was found; open the file by hand", style="yellow")
    return page
