"""Workers of a Dask cluster, on as many machines as it has."""

import asyncio
import contextlib
import logging
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor

from twin.errors import InputError

REACH_SECONDS = 2.0  # of the plain connection that shows whether anything listens at an address
SHAKE_SECONDS = 2.0  # of the handshake of Dask
CONNECT_SECONDS = 20  # of the connection to a Dask scheduler
_LIBRARIES = ("distributed", "tornado", "asyncio")  # their logs would come before the line about a mistake


@contextlib.contextmanager
def dask_workers(address: str, begin: Callable[[], object] | None = None) -> Iterator[tuple[Executor, int]]:
    """Context manager: an executor on a Dask cluster, and the number of tasks that it runs at a time.

    A task whose worker dies is given to another one; `BrokenExecutor` if that happens again and again.
    """
    host, port = check_address(address)
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise InputError("a Dask cluster needs Dask: pip install 'endotwin[cluster]'") from error
    with contextlib.ExitStack() as stack:
        stack.enter_context(_without_logs())
        try:  # a client would wait without end where no scheduler answers
            socket.create_connection((host, port), timeout=REACH_SECONDS).close()
            asyncio.run(_shake_hands(address))
        except Exception as error:  # another server's answer, a missing certificate for tls, and so on
            raise InputError(f"address = {address:.100}: no Dask scheduler answers there") from error
        client = stack.enter_context(Client(address, timeout=CONNECT_SECONDS, set_as_default=False))
        threads = sum(client.nthreads().values())
        if threads == 0:
            start = f"start some with `dask worker {address} --nthreads 1`"
            raise InputError(f"address = {address}: the scheduler has no workers: {start}")
        if begin is not None:
            client.run(begin)
        try:
            yield client.get_executor(pure=False), threads
        except (KilledWorker, CancelledError) as error:
            lost = "the Dask cluster lost its workers or the task"
            rest = "complete files are kept; the same command continues"
            raise BrokenExecutor(f"{lost}; {rest}") from error


def check_address(address: str) -> tuple[str, int]:
    """Return the host and the port of the address of a scheduler."""
    found = re.fullmatch(r"(?:tcp|tls)://(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]{1,253}):([0-9]{1,5})", address)
    if not found or not 1 <= int(found[2]) <= 65535:
        example = "must be as in tcp://192.168.0.7:8786 (or tls), its port from 1 to 65535"
        raise InputError(f"address = {address!r:.60}: {example}")
    return found[1].strip("[]"), int(found[2])


async def _shake_hands(address: str) -> None:
    """Connect to a scheduler as a client does, and leave."""
    from distributed.comm.core import connect
    from distributed.security import Security

    secrets = Security().get_connection_args("client")
    connecting = connect(address, timeout=SHAKE_SECONDS, **secrets)
    (await asyncio.wait_for(connecting, SHAKE_SECONDS + 1)).abort()


@contextlib.contextmanager
def _without_logs() -> Iterator[None]:
    """Context manager: the libraries of a cluster log nothing."""
    loggers = [
        logger
        for name, logger in list(logging.root.manager.loggerDict.items())
        if isinstance(logger, logging.Logger) and name.partition(".")[0] in _LIBRARIES
    ]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
