"""Requests to end, by Ctrl-C or SIGTERM: a flag, which loops read by `look`.

Nothing is raised where a request comes. That may be in the midst of a callback of C, which loses an exception or is
torn by it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator

PATIENCE = 20.0
"""s in which a loop has to read the flag; then the process ends as by a second request."""

APART = 0.5
"""s by which a second request is later than the first: `make` sends its children what they were sent already."""

SAID = 2.0
"""s after which a request that no loop has read is acknowledged."""

_requests: list[int] = []
_raised = 0
_writing = threading.RLock()


def look() -> None:
    """Called by every loop that may take long, where it can be left.

    Raises:
        KeyboardInterrupt: the end was asked for; once for each request, so that what is there can be written.
    """
    global _raised
    if _raised < len(_requests):
        _raised = len(_requests)
        raise KeyboardInterrupt


def requested() -> int:
    """Number of the signal that asked for the end, 0 if none did."""
    return _requests[-1] if _requests else 0


def writing() -> contextlib.AbstractContextManager[object]:
    """While a file is written a second request waits."""
    return _writing


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """In a program that calls this package, Ctrl-C is a flag while C calls back, and what was set comes back after it.

    Raises:
        KeyboardInterrupt: it came, and no loop has read it.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _: _requests.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    look()


# the command line ----------------------------------------------------------------------------------------------------


def listen() -> None:
    """Of the command line alone: a first request sets the flag. A second ends the process, but for a file that is being
    written; so does `PATIENCE`.

    The system writes a signal's number to a socket, and a thread reads it: it hears a request while the main thread
    is in a library and runs no Python.
    """
    global _mouth
    if _mouth is not None:
        return
    ear, _mouth = socket.socketpair()
    _mouth.setblocking(False)
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as a shell starts what runs in the background
            signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(_mouth.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_hear, args=[ear], daemon=True).start()


_mouth: socket.socket | None = None


def _hear(ear: socket.socket) -> None:
    _requests.append(ear.recv(1)[0])
    began, told = time.monotonic(), False
    ear.settimeout(APART)
    while True:
        again = 0
        with contextlib.suppress(TimeoutError):
            again = ear.recv(1)[0]
        past = time.monotonic() - began
        if again and past > APART or not _raised and past > PATIENCE:
            with _writing:
                leave(again or _requests[0], "ended at once; the same command goes on from what is finished")
        if not (told or _raised) and past > SAID:
            told = True
            _say("will end as soon as the present step is done; once more ends it at once")


def leave(number: int, why: str = "") -> None:
    """End the process now, and those it has started: threads of libraries may crash while the interpreter is taken
    down."""
    for process in sys.modules["multiprocessing"].active_children() if "multiprocessing" in sys.modules else ():
        process.terminate()
    if why:
        _say(f"error: {why}")
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, RuntimeError):
            stream.flush()
    os._exit(128 + number)


def _say(text: str) -> None:
    with contextlib.suppress(OSError):
        os.write(2, f"{text}\n".encode())
