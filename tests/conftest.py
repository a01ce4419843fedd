"""Settings of the whole suite; runs before anything imports numba."""

import atexit
import os
import shutil
import tempfile

from hypothesis import settings

# Numba sees a change of the file that holds a cached function, not of the helpers it calls: start from nothing
if "NUMBA_CACHE_DIR" not in os.environ:
    os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="brdftab-kernels-")
    atexit.register(shutil.rmtree, os.environ["NUMBA_CACHE_DIR"], ignore_errors=True)
os.environ.setdefault("MPLBACKEND", "Agg")
# tests neither read nor fill the user's own tables
os.environ["BRDFTAB_CACHE_DIR"] = tempfile.mkdtemp(prefix="brdftab-tables-")
atexit.register(shutil.rmtree, os.environ["BRDFTAB_CACHE_DIR"], ignore_errors=True)

# the same examples in every run; pytest --hypothesis-profile=default draws new ones
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
