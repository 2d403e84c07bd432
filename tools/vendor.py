"""The files of others that are kept here: compared with their checksums, or fetched anew.

python tools/vendor.py            compare
python tools/vendor.py --renew    fetch the versions of tools/vendored.toml with npm, compare
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def listed() -> list[dict[str, str]]:
    """What tools/vendored.toml lists."""
    told: list[dict[str, str]] = tomllib.loads((ROOT / "tools/vendored.toml").read_text())["file"]
    return told


def changed() -> list[str]:
    """Paths whose content is not that of the list."""
    return [
        told["path"]
        for told in listed()
        if hashlib.sha256((ROOT / told["path"]).read_bytes()).hexdigest() != told["sha256"]
    ]


def renew() -> None:
    """Fetch every package once and take the listed members out of it."""
    for package in sorted({f"{told['package']}@{told['version']}" for told in listed()}):
        with tempfile.TemporaryDirectory() as folder:
            pack = ["npm", "pack", "--silent", "--pack-destination", folder, package]
            subprocess.run(pack, check=True)
            [archive] = Path(folder).glob("*.tgz")
            with tarfile.open(archive) as held:
                for told in listed():
                    if f"{told['package']}@{told['version']}" == package:
                        member = held.extractfile(f"package/{told['member']}")
                        assert member is not None
                        (ROOT / told["path"]).write_bytes(member.read())


if __name__ == "__main__":
    if "--renew" in sys.argv[1:]:
        renew()
    if others := changed():
        sys.exit(f"not what tools/vendored.toml lists: {', '.join(others)}")
