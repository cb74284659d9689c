"""How things go wrong: the two exceptions the command line turns into one sentence and an exit code."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class UserError(Exception):
    """A mistake in the input. Its text is one sentence naming file, key, what is wrong and what to do.

    Attributes:
        key: dotted, of what is wrong; empty where the sentence tells. file: in which it stands, where that is known.
    """

    def __init__(self, sentence: str, key: str = "", file: object = None) -> None:
        super().__init__(sentence)
        self.key, self.file = key, file

    def __str__(self) -> str:
        place = "".join(f"{word}: " for word in (self.file, self.key) if word)
        return "\n".join(place + line for line in str(self.args[0]).split("\n"))


class NotConverged(Exception):
    """A solve or a check that did not succeed although the input is well formed (exit code 1)."""


@contextmanager
def at(key: str, file: object = None) -> Iterator[None]:
    """A mistake in here is one at a key, which stands before the mistake's own.

    A key may also say why something is read at all: then it stands before what is wrong there, whole. file: in which
    the key is, where that is known; it is not named again.
    """
    try:
        yield
    except UserError as error:
        if error.file:
            error.file = None if error.file == file else error.file
            error.args, error.key = (str(error),), ""
        error.key, error.file = ".".join(filter(None, (key, error.key))), file
        raise


@contextmanager
def of_file(path: object) -> Iterator[None]:
    """A mistake in here stands in a file, if it is not one of another file."""
    try:
        yield
    except UserError as error:
        error.file = error.file or path
        raise


def in_its_file(work: Callable[P, T]) -> Callable[P, T]:
    """A function whose mistakes stand in the file that its first argument is, or that this was read from."""

    @wraps(work)
    def within(*args: P.args, **kwargs: P.kwargs) -> T:
        first: Any = args[0] if args else kwargs["path"]
        with of_file(getattr(first, "path", first)):
            return work(*args, **kwargs)

    return within
