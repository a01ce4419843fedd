"""The command line: one thin function a command; everything heavy is imported inside."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import click

from brdftab._version import __version__
from brdftab.errors import BrdftabError

_COMMANDS = {
    "albedo": "brdftab.cli.albedo:albedo",
    "check": "brdftab.cli.check:check",
