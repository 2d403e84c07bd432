"""docs/howto/cluster.md runs as printed: scheduler, workers, sweep, fit, a worker killed."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine, load_sweep
from patience import PATIENCE
from recorded import DEMO

pytest.importorskip("distributed", reason="needs Dask: pip install 'dualdrive[distributed]'")

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "cluster.md").read_text()
#: what the page begins, ended whatever happens; in its own order, so that no port is asked in vain
BEFORE, AFTER = "set -e; trap 'kill -9 $(jobs -p) 2> /dev/null' EXIT\n", "exit 0\n"


def script() -> str:
    """All blocks, in one shell; Python in between."""
    found = re.findall(r"^```(sh|python)\n(.*?)^```", PAGE, re.M | re.S)
    assert {language for language, _ in found} == {"sh", "python"}
    lines = [text if kind == "sh" else f"python - <<'END'\n{text}END\n" for kind, text in found]
    return BEFORE + "".join(lines) + AFTER


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.mark.long
def test_the_page_runs_as_printed(tmp_path: Path) -> None:
    for name in ("machine.toml", "fit.csv"):
        shutil.copy(DEMO / name, tmp_path)
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    quiet = {"DASK_DISTRIBUTED__SCHEDULER__DASHBOARD__ENABLED": "false"}
    done = subprocess.run(
        ["bash", "-c", script().replace("8786", str(free_port()))],
        cwd=tmp_path,
        env={**os.environ, **quiet, "PATH": programs},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    here, there, killed = (
        load_sweep(tmp_path / f"{name}.h5").dataset for name in ("here", "there", "killed")
    )
    for name in {str(name) for name in here.variables} - {"speed"}:
        np.testing.assert_array_equal(there[name], here[name])
    assert set(killed["status"].values) == {"success"}
    assert killed.sizes["meshes.gap"] == 400
    assert "free" not in Machine.load(tmp_path / "fitted.toml").history[-1]["change"]
