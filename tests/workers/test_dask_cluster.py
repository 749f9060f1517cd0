"""A Dask cluster makes the same dataset, though one of its workers is killed."""

import contextlib
import os
import signal
import socketserver
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor

import pytest
from distributed import KilledWorker, LocalCluster
from small_dataset import contents
from workers_recipe import RECIPE

from twin.dataset.write import write_dataset
from twin.workers.dask_cluster import check_address, dask_workers


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


def test_cluster_makes_the_same_bytes_though_a_worker_is_killed_in_the_middle(cluster, local, tmp_path):
    folder, killed = tmp_path / "cluster", []

    def kill_one() -> None:
        """As soon as there is a first episode, and while others are being made."""
        while not list(folder.glob("*.mcap")):
            time.sleep(0.005)
        pid = next(iter(cluster.workers.values())).pid
        killed.append(len(list(folder.glob("*.mcap"))))
        os.kill(pid, signal.SIGKILL)

    threading.Thread(target=kill_one, daemon=True).start()
    with dask_workers(cluster.scheduler_address) as (executor, workers):
        assert workers == 2
        # Small tasks, so that most of them are still to be done when the worker dies.
        write_dataset(RECIPE, folder, executor, workers=10)
    assert killed
    assert 0 < killed[0] < RECIPE.episodes
    assert contents(folder) == contents(local)


@contextlib.contextmanager
def server(answer: bytes) -> Iterator[int]:
    """Another server, which says something to every client, and waits if that is nothing."""

    class Answer(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            self.request.sendall(answer)
            if not answer:
                self.request.recv(1 << 16)
                time.sleep(20)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Answer) as listening:
        listening.daemon_threads, listening.block_on_close = True, False
        threading.Thread(target=listening.serve_forever, daemon=True).start()
        yield listening.server_address[1]
        listening.shutdown()


@pytest.mark.parametrize(
    ("scheme", "answer"),
    [("tcp", None), ("tls", b""), ("tcp", b"HTTP/1.1 400 Bad Request\r\n\r\n"), ("tls", b"\xff" * 4096)],
)
def test_scheduler_that_does_not_answer_is_refused_in_one_line_and_soon(
    monkeypatch, caplog, capfd, scheme, answer
):
    monkeypatch.setattr("twin.workers.dask_cluster.SHAKE_SECONDS", 0.5)
    with contextlib.nullcontext(9) if answer is None else server(answer) as port:
        address, begun = f"{scheme}://127.0.0.1:{port}", time.monotonic()
        with (
            pytest.raises(ValueError, match=f"^address = {address}: no Dask scheduler answers there$"),
            dask_workers(address),
        ):
            pass
        assert time.monotonic() - begun < 8
    assert caplog.text == ""
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "address",
    [
        *("", "127.0.0.1:8786", "http://h:1", "tcp://h", "tcp://h:0", "tcp://h:65536", "tcp://:1"),
        *("tcp://a b:1", "tcp://h:1/x", "tcp://h:1\n", "tcp://[::1]", "tcp://h:\u0661", f"tcp://{'h' * 999}"),
    ],
)
def test_what_is_no_address_is_refused_with_an_example(address):
    with pytest.raises(ValueError, match=r"^address = .{2,60}: must be as in tcp://192\.168\.0\.7:8786"):
        check_address(address)


def test_cluster_that_gives_a_task_up_names_what_to_do(cluster):
    with (
        pytest.raises(
            BrokenExecutor, match="lost its workers or the task; complete files are kept; the same command"
        ),
        dask_workers(cluster.scheduler_address),
    ):
        raise KilledWorker("make_files", None, 3)
