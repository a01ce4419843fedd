"""brdftab: BRDF models as numbers you can trust.

The public names stand in ``__init__.pyi`` and load on first use, so that ``import brdftab`` costs nothing.
"""

import lazy_loader

from brdftab._version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
