"""The files of ``page/``, their import map and the policies under which a browser runs them."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Final

__all__ = ["KINDS", "digest", "import_map", "index", "own_imports", "policy", "read"]

KINDS: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}
_UPLOT: Final = "vendor/uPlot.esm.js"


@cache
def read(name: str) -> bytes:
    """A file of the page by its name. KeyError where there is none."""
    if name not in names():
        raise KeyError(name)
    return files("dualdrive.web").joinpath("page", *name.split("/")).read_bytes()


@cache
def names() -> frozenset[str]:
    """Every file of the page; what is asked for is looked up here."""
    root = files("dualdrive.web").joinpath("page")
    found = {item.name for item in root.iterdir() if item.is_file()}
    return frozenset(found | {f"vendor/{item.name}" for item in root.joinpath("vendor").iterdir()})


@cache
def module_names() -> tuple[str, ...]:
    """The modules of the page, without the vendored one."""
    return tuple(sorted(n for n in names() if n.endswith(".js") and "/" not in n))


def import_map(address: Callable[[str], str]) -> str:
    """The import map: every module under ``dd/name`` and uPlot, wherever `address` has them."""
    known = {f"dd/{name}": address(name) for name in module_names()}
    return json.dumps({"imports": {"uplot": address(_UPLOT), **known}})


def own_imports(wanted: tuple[str, ...]) -> str:
    """The import map of a page that stands alone: these modules as data, nothing fetched."""
    told = json.loads(import_map(lambda name: name))["imports"]
    kept = {
        key: "data:text/javascript;base64," + base64.b64encode(read(name)).decode()
        for key, name in told.items()
        if name in (*wanted, _UPLOT)
    }
    return json.dumps({"imports": kept})


def digest(script: str) -> str:
    """How a policy names an inline script."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def index() -> bytes:
    """The page with its import map; all modules are asked for at once, not one after another."""
    wanted = (*(n for n in module_names() if n != "report.js"), _UPLOT)
    links = "\n".join(f'<link rel="modulepreload" href="./{name}">' for name in wanted)
    page = read("index.html").replace(b"%IMPORTS%", import_map(lambda n: f"./{n}").encode())
    return page.replace(b"%PRELOADS%", links.encode())


def policy() -> str:
    """Own files alone, no inline script but the import map; inline sizes come from the plots."""
    return (
        "default-src 'none'; connect-src 'self'; img-src 'self' data: blob:; form-action 'none'; "
        "style-src 'self' 'unsafe-inline'; base-uri 'none'; frame-ancestors 'none'; "
        f"script-src 'self' {digest(import_map(lambda n: f'./{n}'))}"
    )
