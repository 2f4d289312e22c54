"""Plug-ins that a test registers without installation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from campaign.backends import backends
from campaign.backends.interface import BackendKind
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment
from campaign.export import exports
from campaign.export.interface import ExportKind
from campaign.physics.compensation import compensation_methods
from campaign.physics.compensation.interface import CompensationMethod
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionModel
from campaign.plugins import Kinds
from campaign.report.formats import formats
from campaign.report.formats.interface import Format

AnyKind = Experiment | FrictionModel | CompensationMethod | BackendKind | ExportKind | Format
ROOMS: dict[type, Callable[[], Kinds[Any]]] = {
    Experiment: experiments,
    FrictionModel: friction_models,
    CompensationMethod: compensation_methods,
    BackendKind: backends,
    ExportKind: exports,
    Format: formats,
}


@contextmanager
def known(*kinds: AnyKind) -> Iterator[None]:
    """Register `kinds` for protocols and benches within the block, as if they were installed."""
    with ExitStack() as stack:
        for kind in kinds:
            stack.enter_context(ROOMS[type(kind)]().including(kind))
        yield
