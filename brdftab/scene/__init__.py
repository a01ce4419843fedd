"""What a scene needs of its materials: scene file -> plan -> tables of only that, with a bound on what is left out."""

from brdftab.scene.execute import carry_out
from brdftab.scene.interpolation import expand, interpolate
from brdftab.scene.plan import Item, Plan
from brdftab.scene.planner import plan_material, plan_scene
from brdftab.scene.scene import Material, Scene, parse, read
from brdftab.scene.verify import verify

__all__ = [
    "Item",
    "Material",
    "Plan",
    "Scene",
    "carry_out",
    "expand",
    "interpolate",
    "parse",
    "plan_material",
    "plan_scene",
    "read",
    "verify",
]
