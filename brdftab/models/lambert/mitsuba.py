"""Which plugin of Mitsuba 3 computes the same."""

from __future__ import annotations

from typing import Any

import numpy as np

from brdftab.models.resolve import Setup


def plugin(setup: Setup) -> dict[str, Any] | str:
    """Return the plugin's dictionary, or why there is none."""
    kd = np.broadcast_to(setup.values["kd"], 3)
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(map(float, kd))}}
