"""The commands: they parse, call and print. They import heavy modules themselves."""

from campaign.cli.bench_commands import app
from campaign.cli.main import main

__all__ = ["app", "main"]
