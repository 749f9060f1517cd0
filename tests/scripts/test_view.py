"""`endotwin view`: mistakes in one line, an end without an error, and pages of others that are refused."""

import json
import re
import signal
import socket
import subprocess

import pytest
from repository import ENVIRONMENT, command, endotwin
from typed import typed
from viewed import asked, serving

connect = pytest.importorskip("websockets.sync.client").connect
pytest.importorskip("viser")


def test_ctrl_c_ends_it_without_an_error(tmp_path):
    with serving("--json", cwd=tmp_path) as (process, port):
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (0, "")
    assert json.loads(out)["url"] == f"http://127.0.0.1:{port}"
    assert not any(tmp_path.iterdir())


def test_pages_of_others_are_refused_and_a_termination_is_no_error(tmp_path):
    from viser import __version__
    from websockets.exceptions import InvalidStatus

    with serving(cwd=tmp_path) as (process, port):
        assert asked(port, {"Host": f"localhost:{port}"})[0] == 200  # through an SSH tunnel
        status, text = asked(port, {"Host": f"evil.example:{port}"})
        assert (status, text) == (403, "this machine is not 'evil.example': open its address\n")
        url, protocols = f"ws://127.0.0.1:{port}", [f"viser-v{__version__}"]
        with connect(url, origin=f"http://127.0.0.1:{port}", subprotocols=protocols) as own:
            assert own.recv(timeout=30)
        for origin in ("https://evil.example", "https://app.foxglove.dev", "null"):
            with pytest.raises(InvalidStatus, match="403"):
                connect(url, origin=origin, subprotocols=protocols)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (0, "")
    assert re.fullmatch(rf"http://127.0.0.1:{port}: closed after \d+ s\n", out)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("view --port 70000", "--port 70000: must be from 0 to 65535"),
        ("view --port -1", "--port -1: must be from 0 to 65535"),
        ("view --port x", "--port"),
        ("view ureterscope", "unknown preset 'ureterscope' (did you mean 'ureteroscope'?)"),
        ("view missing.mcap", "missing.mcap"),
        ("view text.mcap", "text.mcap is not an MCAP file"),
        ("view --policy missing.onnx", "missing.onnx"),
        ("view text.mcap --policy p.onnx", "--policy: a recording shows its own estimate"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, line, said):
    (tmp_path / "text.mcap").write_text("no recording")
    code, out, err = typed(line, tmp_path)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_port_in_use_is_one_line(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        code, _, err = typed(f"view --port {port}", tmp_path)
    assert code == 2
    assert err == (
        f"endotwin view: port {port} of 127.0.0.1: Address already in use; "
        "choose another --port, or 0 for a free one\n"
    )


def test_without_the_package_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    code, _, err = typed("view", tmp_path)
    assert code == 2
    assert err == "endotwin view: this needs viser: pip install 'endotwin[view]'\n"


def test_other_verbs_import_nothing_of_it(tmp_path):
    words = (
        "import sys, scripts.view, twin.view; sys.exit(bool({'viser', 'mujoco', 'trimesh'} & {*sys.modules}))"
    )
    ended = subprocess.run([command()[0], "-c", words], env=ENVIRONMENT, cwd=tmp_path)
    assert ended.returncode == 0
    assert endotwin("view", "--help", cwd=tmp_path).stdout.count("endotwin view") >= 3
