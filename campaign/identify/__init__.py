"""Parameters of a rig from archived runs: trials, analyses of experiments, bench file, page."""

from __future__ import annotations

from collections.abc import Mapping

from campaign.experiments import experiments
from campaign.experiments.interface import Experiment


def experiments_by_model() -> Mapping[str, Experiment]:
    """Every experiment whose analysis identifies, by the name of its model.

    Packages that cannot be used are left out. A name of the program stays the program's.
    """
    kinds = experiments()
    every = [(kinds.plug_in(name) is None, kind) for name, kind in kinds.described()]
    own_last = sorted(every, key=lambda each: each[0])
    found = {kind.model.name: kind for _, kind in own_last if isinstance(kind, Experiment)}
    return {name: found[name] for name in sorted(found) if name}
