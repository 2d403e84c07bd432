"""Loading once what every attempt would load for itself."""

from __future__ import annotations

from importlib import import_module

import click

from dualdrive.units import is_unit
from dualdrive_cli.main import main

_LIBRARIES = (
    "h5netcdf", "h5py", "matplotlib.backends.backend_agg", "matplotlib.figure", "pandas", "rich.progress",
    "scipy.integrate", "scipy.interpolate", "scipy.io", "scipy.linalg", "scipy.optimize", "scipy.signal",
    "scipy.stats", "tomlkit", "xarray", "dualdrive.plots", "dualdrive.store", "dualdrive_cli.__main__", "dualdrive.figures",
)  # fmt: skip


def load_everything() -> None:
    """The verbs, the libraries below them, the table of units."""
    for name in _LIBRARIES:
        import_module(name)
    context = click.Context(main)
    for name in main.list_commands(context):  # type: ignore[attr-defined]
        main.get_command(context, name)  # type: ignore[attr-defined]
    is_unit("N*m")
