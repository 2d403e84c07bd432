"""The house as read from the imports: who may know of whom."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import dualdrive

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "dualdrive"
CLI = ROOT / "cli"

#: what a bare `import dualdrive` must not load; NumPy comes with the core
HEAVY = {"dask", "distributed", "h5py", "matplotlib", "pandas", "pint", "rich", "scipy", "xarray"}
PLOTTING = {"matplotlib"}
#: the writers of runs, of sweeps, of traces
HDF5_WRITERS = {"store.py", "sweeps/layout.py", "traces/export.py"}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@cache
def imported(path: Path) -> tuple[tuple[str, int, bool], ...]:
    """Name every imported module in full, its line, and whether it loads with the file itself."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[tuple[str, int, bool]]:
    tree = parsed(path)
    deferred = {
        id(inner) for outer in ast.walk(tree) if _defers(outer) for inner in ast.walk(outer)
    }
    for node in ast.walk(tree):
        at_once = id(node) not in deferred
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno, at_once
        elif isinstance(node, ast.ImportFrom):
            module = ".".join(filter(None, [enclosing(path, node.level), node.module]))
            for alias in node.names:
                yield f"{module}.{alias.name}", node.lineno, at_once


def enclosing(path: Path, level: int) -> str:
    """Name the package that a relative import of this many dots starts from; "" without dots."""
    if level == 0:
        return ""
    root, name = (CLI, "dualdrive_cli") if path.is_relative_to(CLI) else (PACKAGE, "dualdrive")
    folders = [name, *path.parent.relative_to(root).parts]
    return ".".join(folders[: len(folders) - (level - 1)])


def _defers(node: ast.AST) -> bool:
    """A function's body, or `if TYPE_CHECKING:`, runs after the import or never."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return True
    return isinstance(node, ast.If) and ast.unparse(node.test) in {
        "TYPE_CHECKING",
        "typing.TYPE_CHECKING",
    }


def files(folder: Path) -> list[Path]:
    found = sorted(folder.rglob("*.py"))
    assert found, f"{folder} holds no Python file: this test looks in the wrong place"
    return found


def breaches(
    folder: Path, *, forbidden: set[str], allowed: tuple[str, ...] = (), at_once_only: bool = False
) -> list[str]:
    """Imports of forbidden top-level packages in files that are not below an allowed path."""
    return [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(folder)
        if not path.relative_to(folder).as_posix().startswith(allowed or ("\0",))
        for module, line, at_once in imported(path)
        if module.split(".")[0] in forbidden and (at_once or not at_once_only)
    ]


def test_hdf5_is_known_to_the_store_and_the_traces_alone() -> None:
    assert not breaches(
        PACKAGE,
        forbidden={"h5py", "h5netcdf"},
        allowed=("hdf5.py", "store.py", "sweeps/", "traces/"),
    )


def test_hdf5_is_opened_for_reading_only_outside_its_writers() -> None:
    opened = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in files(PACKAGE)
        if path.relative_to(PACKAGE).as_posix() not in HDF5_WRITERS
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "h5py.File"
        if [ast.unparse(mode) for mode in node.args[1:2]] != ["'r'"]
        and [ast.unparse(word.value) for word in node.keywords if word.arg == "mode"] != ["'r'"]
    ]
    assert not opened, f"give h5py.File the mode 'r'; only {HDF5_WRITERS} write"


def test_the_command_knows_dualdrive_only() -> None:
    own = {"__future__", "click", "rich", "dualdrive", "dualdrive_cli"}
    foreign = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(CLI)
        for module, line, _ in imported(path)
        if module.split(".")[0] not in own | sys.stdlib_module_names
    ]
    assert not foreign


def test_the_command_does_not_reach_behind_the_package() -> None:
    behind = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(CLI)
        for module, line, _ in imported(path)
        if module.startswith("dualdrive._") and not module.startswith("dualdrive.__")
    ]
    assert not behind, "only the package meets the C++ core; the command asks the package"


def test_the_package_does_not_know_the_command() -> None:
    assert not breaches(PACKAGE, forbidden={"dualdrive_cli", "click"})


def test_python_meets_cpp_in_one_module() -> None:
    extensions = {path.name.split(".")[0] for path in PACKAGE.rglob("*.so")}
    assert extensions <= {"_core"}
    assert not breaches(PACKAGE, forbidden={"ctypes", "cffi"})


def test_plotting_is_imported_where_it_is_used() -> None:
    assert not breaches(PACKAGE, forbidden=PLOTTING, at_once_only=True)


def test_python_modules_form_no_circle() -> None:
    """Counted per file or folder of the package, imports inside functions included."""
    graph: dict[str, set[str]] = {}
    for path in files(PACKAGE):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        graph.setdefault(own, set()).update(
            module.split(".")[1]
            for module, _, _ in imported(path)
            if module.startswith("dualdrive.") and not module.startswith(f"dualdrive.{own}.")
        )
    graph.pop("__init__", None)
    TopologicalSorter(graph).prepare()  # raises CycleError, naming the circle


def test_headers_form_no_circle() -> None:
    include = ROOT / "cpp" / "include"
    headers = sorted(include.rglob("*.hpp"))
    assert headers
    TopologicalSorter(
        {
            header.relative_to(include).as_posix(): set(
                re.findall(r'^#include "(.+)"', header.read_text(), re.M)
            )
            for header in headers
        }
    ).prepare()


def test_only_the_solver_knows_sundials() -> None:
    """And the file that says which version it is; no header of ours lets it through to users."""
    sundials = re.compile(r"^#include <(cvodes?|nvector|sun[a-z]+)/", re.M)
    sources = [path for kind in ("*.hpp", "*.cpp") for path in (ROOT / "cpp").rglob(kind)]
    knowing = {path.name for path in sources if sundials.search(path.read_text())}
    assert "version.cpp" in knowing, (
        "no SUNDIALS header found at all: this test looks for the wrong name"
    )
    assert knowing == {"version.cpp", "cvode.cpp"}


@pytest.mark.parametrize("module", ["dualdrive", "dualdrive_cli.main"])
def test_import_is_light(module: str) -> None:
    """Read from the interpreter, so that what a dependency drags in counts too."""
    run = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", f"import {module}"],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = {
        line.rsplit("|", 1)[-1].strip().split(".")[0]
        for line in run.stderr.splitlines()
        if "|" in line
    }
    assert "dualdrive" in loaded, "importtime printed no dualdrive: this test reads it wrongly"
    assert not loaded & HEAVY


def test_a_list_of_all_verbs_loads_no_arithmetic() -> None:
    """`--help` imports every verb: SciPy and the plots would be most of its time."""
    code = """
import sys
from click.testing import CliRunner
from dualdrive_cli.main import main
assert "diagnose" in CliRunner().invoke(main, ["--help"]).output
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "dualdrive.diagnose" in loaded
    assert not loaded & {"scipy", "matplotlib", "pandas", "xarray"}


def test_the_diagnosis_knows_no_effect_by_its_name() -> None:
    """What a law means to it is declared beside the law; a load in time is a family of its own."""
    names = {kind.name for kind in dualdrive._core.effect_types()}
    found = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}: {node.value}"
        for folder in ("diagnose", "innovations", "estimation")
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        if path.name != "loads.py"
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.partition("@")[0] in names
    ]
    assert not found
