"""How things go wrong: the two exceptions the command line turns into one sentence and an exit code."""

from collections.abc import Iterator
from contextlib import contextmanager


class UserError(Exception):
    """A mistake in the input. Its text is one sentence naming file, key, what is wrong and what to do."""


class NotConverged(Exception):
    """A solve or a check that did not succeed although the input is well formed (exit code 1)."""


@contextmanager
def told_of(what: object, folder: object = None) -> Iterator[None]:
    """A mistake that is found here is one of a file, or of a key in it: its sentence begins with that, once, or with
    another file of a folder."""
    try:
        yield
    except UserError as error:
        begun = str(error).startswith(f"{what}: ") or folder is not None and str(error).startswith(str(folder))
        raise UserError(str(error) if begun else f"{what}: {error}") from error
