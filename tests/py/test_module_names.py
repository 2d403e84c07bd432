"""No module is hidden behind a function of its own name: both are imported by their names."""

from __future__ import annotations

import subprocess
import sys
from pkgutil import walk_packages

import dualdrive

CODE = """
import importlib, sys, types
hidden = []
for name in sys.argv[1:]:
    module = importlib.import_module(name)
    package, _, own = name.rpartition(".")
    if not isinstance(getattr(sys.modules[package], own, None), types.ModuleType):
        hidden.append(name)
print(*hidden)
"""


def test_no_module_is_shadowed_by_what_its_package_offers() -> None:
    """In an interpreter of its own: what a package offers is bound when it is imported."""
    every = [m.name for m in walk_packages(dualdrive.__path__, "dualdrive.")]
    assert len(every) > 200
    done = subprocess.run(
        [sys.executable, "-c", CODE, *every], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
