"""The commands: they parse, call and print. Everything heavy is imported inside them."""

from campaign.cli.bench_commands import app
from campaign.cli.main import main

__all__ = ["app", "main"]
