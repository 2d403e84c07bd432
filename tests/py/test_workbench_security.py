"""The workbench answers this computer's own page alone: docs/theory/workbench-security.md."""

from __future__ import annotations

import io
import json
import os
import re
import socket
import stat
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from dualdrive.files import FileError
from dualdrive.workbench.names import accepted, inside
from patience import PATIENCE
from workbench_server import Answer, Running, running, wait_for

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("bench") / "project") as found:
        yield found


# --- who may ask ----------------------------------------------------------------------------------


def test_only_the_loopback_interface_listens(server: Running) -> None:
    """Read from the kernel's table: 0100007F is 127.0.0.1."""
    lines = Path("/proc/net/tcp").read_text().splitlines()[1:]
    own = [line.split()[1] for line in lines if line.split()[3] == "0A"]
    listening = {entry.partition(":")[0] for entry in own if int(entry[-4:], 16) == server.port}
    assert listening == {"0100007F"}
    v6 = Path("/proc/net/tcp6")
    assert f":{server.port:04X}" not in (v6.read_text() if v6.exists() else "")


@pytest.mark.parametrize(
    "where", ["", "state", "main.js", "series", "do/demo", "file/machine.toml"]
)
@pytest.mark.parametrize("token", ["", "x" * 43, "..", "%2e%2e"])
def test_nothing_is_served_without_the_token(server: Running, where: str, token: str) -> None:
    for method in ("GET", "POST"):
        answer = server.ask(method, f"/{token}/{where}", raw=True)
        assert answer.status == 403
        assert "open the address that the terminal shows" in answer.text


def test_a_token_is_long_random_and_new_every_time(server: Running, tmp_path: Path) -> None:
    with running(tmp_path / "another") as other:
        assert other.token != server.token
    assert len(server.token) >= 43


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "127.0.0.1", "localhost:1", "127.0.0.1.nip.io:{port}"],
)
def test_another_host_is_refused(server: Running, host: str) -> None:
    answer = server.ask("GET", "state", host=host.format(port=server.port))
    assert answer.status == 421
    assert "Host" in answer.text


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1:{port}", None]
)
def test_another_origin_changes_nothing(server: Running, origin: str | None) -> None:
    told = origin.format(port=server.port) if origin else None
    assert server.ask("POST", "do/demo", "{}", origin=told).status == 403
    assert server.ask("PUT", "upload/a.csv", "t,theta_m\n", origin=told).status == 403
    assert server.state["traces"] == []


@pytest.mark.parametrize(
    ("path", "origin", "host"),
    [
        ("/live", "own", None),
        ("/" + "x" * 43 + "/live", "own", None),
        ("own", "http://evil.example", None),
        ("own", None, None),
        ("own", "http://evil.example", "evil.example"),
    ],
)
def test_a_socket_needs_token_and_origin_too(
    server: Running, path: str, origin: str | None, host: str | None
) -> None:
    where = f"{server.path}live" if path == "own" else path
    own = server.origin if origin == "own" else origin
    uri = f"ws://{host or '127.0.0.1'}:{server.port}{where}"
    with socket.create_connection(("127.0.0.1", server.port)) as link:
        with pytest.raises(InvalidStatus) as refused:
            connect(uri, sock=link, origin=None if own is None else Origin(own))
        assert refused.value.response.status_code == 403


def test_the_right_socket_is_told_the_state(server: Running) -> None:
    uri = f"ws://127.0.0.1:{server.port}{server.path}live"
    with connect(uri, origin=Origin(server.origin)) as ws:
        assert json.loads(ws.recv(timeout=PATIENCE))["project"] == str(server.project)


def test_answers_carry_the_policies_that_keep_others_out(server: Running) -> None:
    for where in ("", "state", "main.js"):
        headers = server.ask("GET", where).headers
        policy = {k.lower(): v for k, v in headers.items()}
        assert "default-src 'none'" in policy["content-security-policy"]
        assert "unsafe-eval" not in policy["content-security-policy"]
        assert "frame-ancestors 'none'" in policy["content-security-policy"]
        assert policy["referrer-policy"] == "no-referrer"
        assert policy["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in policy
        assert "set-cookie" not in policy


def test_the_session_is_its_owners_alone(server: Running) -> None:
    mode = (server.project / ".session").stat().st_mode
    assert stat.S_IMODE(mode) == 0o600


# --- names and places -----------------------------------------------------------------------------

BAD_NAMES = [
    "../x.csv", "a/../../x.csv", "..", ".hidden.csv", "/etc/passwd.csv", "a\\b.csv", "a\x00.csv",
    "a\n.csv", "con.csv", "<script>.csv", "x.csv ", "x.py", "x.exe", "x.toml.sh", "-rf.csv",
    "$(id).csv", "a" * 300 + ".csv", "\u202evsc.csv",
]  # fmt: skip


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_malicious_name_is_refused_in_words(name: str) -> None:
    with pytest.raises(FileError, match=r"rename it|shorten it"):
        accepted(name)


@pytest.mark.parametrize("name", ["run 12 (b).csv", "Drehtisch_müller.mat", "log10.csv", "轴.h5"])
def test_what_people_call_their_files_is_taken(name: str) -> None:
    assert accepted(name) == name


@pytest.mark.parametrize("name", ["../x.csv", "a%2f..%2f..%2fx.csv", "%2e%2e%2fx.csv", "x.py"])
def test_no_upload_leaves_the_project(server: Running, name: str) -> None:
    before = sorted(p for p in server.project.parent.rglob("*.csv"))
    answer = server.ask("PUT", f"upload/{name}", "t,theta_m\n0,1\n")
    assert answer.status in (400, 404, 405)
    assert sorted(p for p in server.project.parent.rglob("*.csv")) == before


@pytest.mark.parametrize(
    "where", ["../project.json", "%2e%2e/project.json", "vendor/../../keep.py", "//etc/passwd"]
)
def test_no_file_of_elsewhere_is_served(server: Running, where: str) -> None:
    for prefix in ("", "file/", "vendor/"):
        answer = server.ask("GET", prefix + where)
        assert answer.status in (400, 403, 404)
        assert "schema" not in answer.text


def test_a_link_out_of_the_project_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    (tmp_path / "secret").write_text("x")
    (tmp_path / "project" / "a.csv").symlink_to(tmp_path / "secret")
    with pytest.raises(FileError, match="leads out of the project"):
        inside(tmp_path / "project", "a.csv")


def test_series_of_elsewhere_are_not_read(server: Running) -> None:
    for store in ("../../etc/series", "1/../../x", "1/fit/../series", "-1/series", ""):
        told = {"keys": [[store, "x", "y"]], "start": 0, "stop": 1, "pixels": 9}
        answer = server.ask("POST", "series", json.dumps(told))
        assert answer.status == 400
        assert "no such series" in answer.json["refused"]


# --- sizes ----------------------------------------------------------------------------------------


def test_two_gigabytes_are_refused_before_they_come(server: Running) -> None:
    head = f"PUT {server.path}upload/big.csv HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
    head += f"Origin: {server.origin}\r\nContent-Length: {2 * 10**9}\r\n\r\n"
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as link:
        link.sendall(head.encode())
        answer = ""
        while "}" not in answer and (piece := link.recv(4000)):
            answer += piece.decode()
    assert " 400 " in answer
    assert "more than 1 GB" in answer


def test_an_upload_that_lies_about_its_length_is_cut(server: Running) -> None:
    """Chunked, of a machine file, whose limit is a megabyte."""
    head = f"PUT {server.path}upload/m.toml HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
    head += f"Origin: {server.origin}\r\nTransfer-Encoding: chunked\r\n\r\n"
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as link:
        link.sendall(head.encode())
        try:
            for _ in range(40):
                link.sendall(b"10000\r\n" + b"#" * 0x10000 + b"\r\n")
        except OSError:  # it hung up: that is what it may
            pass
        answer = b""
        while piece := link.recv(4000):
            answer += piece
            if b"}" in answer:
                break
    assert "more than 1 MB" in answer.decode()
    assert not list((server.project / "models").iterdir())


def test_a_command_of_a_megabyte_or_of_nonsense_is_refused(server: Running) -> None:
    for body in ("[" * 200_000, '"' + "x" * 2_000_000 + '"', "[]", "{", "nul"):
        answer = server.ask("POST", "do/role", body)
        assert answer.status == 400
        assert "JSON" in answer.text or "bytes" in answer.text
    for told in ({"keys": [["1/fit", "a", "b"]] * 500}, {"pixels": 10**9}, {"start": 1, "stop": 0}):
        whole = {"keys": [], "start": 0, "stop": 1, "pixels": 100, **told}
        assert server.ask("POST", "series", json.dumps(whole)).status == 400
    assert server.ask("POST", "do/__class__", "{}").status == 400


@pytest.mark.parametrize(
    ("method", "where", "body"),
    [
        ("POST", "series", '{"keys": [], "start": 0, "stop": 1, "pixels": 1e999}'),
        ("POST", "series", '{"keys": [["1/fit"]], "start": 0, "stop": 1, "pixels": 10}'),
        ("POST", "series", '{"keys": 5, "start": 0, "stop": 1, "pixels": 10}'),
        ("POST", "series", '{"keys": [], "start": NaN, "stop": 1, "pixels": 10}'),
        ("POST", "do/cancel", '{"number": 1e999}'),
        ("POST", "do/map", '{"trace": {}, "map": [[]]}'),
        ("POST", "do/preset", "{}"),
        ("GET", "view/" + "9" * 400, None),
        ("GET", "view/" + "9" * 5000, None),
    ],
)
def test_numbers_beyond_all_bounds_are_refused_in_words(
    server: Running, method: str, where: str, body: str | None
) -> None:
    """Not met by an error of the server, of which its log would fill."""
    answer = server.ask(method, where, body)
    assert answer.status in (400, 404)
    assert answer.json["refused"]


# --- what files hold ------------------------------------------------------------------------------


def upload(server: Running, name: str, body: bytes) -> Answer:
    return server.ask("PUT", f"upload/{name}", body)


def message_of(server: Running, name: str) -> str:
    """What the page says of a recording once it was looked at."""

    def told() -> list[dict[str, str]]:
        return [t for t in server.state["traces"] if t["name"] == name and t["status"] == "unread"]

    wait_for(told)
    return told()[0]["message"]


def test_an_hdf5_bomb_is_refused_in_words(server: Running) -> None:
    held = io.BytesIO()
    with h5py.File(held, "w") as file:  # 8 TB in a few hundred bytes
        file.create_dataset("theta_m", (10**12,), "f4", chunks=(10**6,), compression="gzip")
        file.create_dataset("t", (10**12,), "f4", chunks=(10**6,), compression="gzip")
    assert len(held.getvalue()) < 100_000
    assert upload(server, "bomb.h5", held.getvalue()).status == 200
    assert "memory" in message_of(server, "bomb")


def test_a_mat_bomb_is_refused_in_words(server: Running) -> None:
    """A few hundred bytes that say they unpack to 32 GB."""
    held = io.BytesIO()
    scipy.io.savemat(held, {"theta_m": np.zeros((2, 3))})  # type: ignore[arg-type]  # a file will do
    head, body = held.getvalue()[:128], held.getvalue()[128:]
    body = body.replace(struct.pack("<ii", 2, 3), struct.pack("<ii", 2, 2 * 10**9))
    packed = zlib.compress(body)
    bomb = head + struct.pack("<II", 15, len(packed)) + packed
    assert len(bomb) < 400
    assert upload(server, "zeros.mat", bomb).status == 200
    assert "not a readable MAT file" in message_of(server, "zeros")


def test_an_object_array_of_a_mat_file_runs_nothing(server: Running, tmp_path: Path) -> None:
    evil = tmp_path / "evil"
    pickle = b"cos\nsystem\n(S'touch " + os.fsencode(evil) + b"'\ntR."
    assert upload(server, "evil.mat", b"MATLAB 5.0 MAT-file" + b" " * 105 + pickle).status == 200
    assert upload(server, "evil.h5", b"\x89HDF\r\n\x1a\n" + pickle).status == 200
    assert message_of(server, "evil")
    assert not evil.exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 100_000, "bomb.toml"),
        ("schema = 1\n" + "\n".join(f"[a{'.a' * k}]" for k in range(400)), "a"),
        ('schema = 1\nbase = "../../../../etc/passwd"', "rests on a preset or on nothing"),
        ('schema = 1\nbase = "/proc/self/environ"', "rests on a preset or on nothing"),
    ],
)
def test_a_machine_bomb_or_one_that_reads_elsewhere_is_refused(
    server: Running, text: str, said: str
) -> None:
    known = {told["id"] for told in server.state["messages"]}
    answer = upload(server, "bomb.toml", text.encode())
    assert answer.status == 200

    def told() -> list[dict[str, str]]:
        return [m for m in server.state["messages"] if m["id"] not in known]

    wait_for(told)
    assert told()[0]["kind"] == "error"
    assert said in told()[0]["text"]
    assert len(told()[0]["text"]) < 600
    assert server.state["machine"] is None


def test_a_formula_of_a_machine_file_is_no_python(server: Running, tmp_path: Path) -> None:
    evil = tmp_path / "evil"
    text = (
        'schema = 1\nbase = "bench"\n[[effects]]\neffect = "expression"\nplace = "table"\n'
        f"formula = \"__import__('os').system('touch {evil}')\"\n"
    )
    known = {told["id"] for told in server.state["messages"]}
    upload(server, "formula.toml", text.encode())
    wait_for(lambda: {m["id"] for m in server.state["messages"]} - known)
    assert server.state["messages"][-1]["kind"] == "error"
    assert not evil.exists()


def test_the_page_takes_no_markup_from_data() -> None:
    """Text is put in as text: no module sets HTML."""
    page = Path(__file__).resolve().parents[2] / "python" / "dualdrive" / "web" / "page"
    for module in page.glob("*.js"):
        text = module.read_text()
        for word in (
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
            "new Function",
        ):
            assert word not in text, f"{module.name}: {word}"


def test_every_threat_has_its_test() -> None:
    """By the table of the docs; and the tests of this file stand in it, but for what is let in."""
    told = (ROOT / "docs" / "theory" / "workbench-security.md").read_text("utf-8")
    lines = [line for line in told.splitlines() if line.startswith("| ")][1:]
    here, every = (
        re.findall(r"^def test_(\w+)", "\n".join(p.read_text("utf-8") for p in several), re.M)
        for several in ([Path(__file__)], sorted(Path(__file__).parent.glob("test_*.py")))
    )
    named = [re.findall(r"`(\w+)`", line.rpartition(" | ")[2]) for line in lines]
    assert all(named), "a threat without a test"
    prefixes = [name for own in named for name in own]
    assert [n for n in prefixes if not any(test.startswith(n) for test in every)] == []
    let_in = ("the_right_socket", "what_people_call", "every_threat")
    assert [t for t in here if not t.startswith((*prefixes, *let_in))] == []
