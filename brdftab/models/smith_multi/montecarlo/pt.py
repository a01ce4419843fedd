"""Path tracing with next event estimation at every vertex (Wang et al. 2022, Sec. 4.1): orders two and above.

The single bounce is known exactly and carries no noise. A walk is drawn from visible normals, so that only F and the
chance to meet the next facet remain in its throughput; it has no last bounce, as dim walks end at random. At facets of
a dielectric F decides between reflection and refraction.
"""

from __future__ import annotations

from brdftab.models._shared.random_walk.reflecting import reflecting
from brdftab.models._shared.random_walk.refracting import transmitting
from brdftab.models._shared.random_walk.sampling_plan import PathSampler
from brdftab.models.resolve import Setup


def path_samplers(setup: Setup, tolerance: float) -> list[PathSampler]:
    """Return how paths are drawn: all wavelengths together, or a path sampler for each refractive index."""
    return transmitting(setup, heights=False) if setup.transmits else [reflecting(setup, tolerance, heights=False)]
