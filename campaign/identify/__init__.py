"""Parameters of a rig from archived runs: trials, analyses of experiments, bench file, page."""

from __future__ import annotations

from collections.abc import Mapping

from campaign.experiments import experiments
from campaign.experiments.interface import Experiment


def experiments_by_model() -> Mapping[str, Experiment]:
    """Every experiment whose analysis identifies, by the name of its model.

    Packages that cannot be used are left out. A name of the program stays the program's; one that
    two packages claim is nobody's, as of every kind.
    """
    kinds = experiments()
    claims: dict[tuple[str, bool], list[Experiment]] = {}
    for name, kind in kinds.described():
        if isinstance(kind, Experiment) and kind.model.name:
            claims.setdefault((kind.model.name, kinds.plug_in(name) is None), []).append(kind)
    single = {claim: kind for claim, (kind, *others) in sorted(claims.items()) if not others}
    return {name: kind for (name, _), kind in single.items()}  # the program's comes last
