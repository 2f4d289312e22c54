"""Parameters of a rig from archived runs: trials, analyses of experiments, bench file, page."""

from __future__ import annotations

from collections.abc import Mapping

from campaign.experiments import experiments
from campaign.experiments.interface import Experiment


def experiments_by_model() -> Mapping[str, Experiment]:
    """Experiments whose analysis identifies parameters, by the name of their model.

    Leaves out unusable packages and names that two packages claim. The program's own experiment
    takes precedence over a package.
    """
    kinds = experiments()
    claims: dict[tuple[str, bool], list[Experiment]] = {}
    for name, kind in kinds.described():
        if isinstance(kind, Experiment) and kind.model.name:
            claims.setdefault((kind.model.name, kinds.plug_in(name) is None), []).append(kind)
    single = {claim: kind for claim, (kind, *others) in sorted(claims.items()) if not others}
    return {name: kind for (name, _), kind in single.items()}  # the program's comes last
