"""The points of a case that are finished, kept while it runs, so that it goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..case import checkpoint
from ..case.assemble import Built
from ..contact.kinds import sources_of_others
from ..files import store
from ..results import Journal, open_journal
from .stage import hash_of_code


def hashes_of(files: Mapping[str, Path]) -> dict[str, str]:
    """Name -> hash of files; what is missing is told where it is read."""
    return {name: store.hash_file(file) for name, file in files.items() if file.is_file()}


@dataclass
class Checkpoint:
    """Where the finished points of a case are kept: `journal` opens its file.

    Attributes:
        file: the journal. raw: the case file. modal_files: body of the case -> its modal file. fresh: forget what is
            there. begin: is called before anything is written. whole_sweep: the points depend on the sweep that they
            are points of, as where a motion may be one of several.
    """

    file: Path
    raw: Mapping[str, Any]
    modal_files: Mapping[str, Path]
    fresh: bool
    begin: Callable[[], None]
    whole_sweep: bool = False

    @contextmanager
    def journal(self, built: Built) -> Iterator[Journal]:
        """The journal of an assembly; see `results.open_journal`."""
        names = {body: str(file) for body, file in self.modal_files.items()}
        head = checkpoint.head_of(built, self.raw, hashes_of(self.modal_files), names) | {"finished": False}
        self.begin()
        with open_journal(self.file, self.inputs(built), head, self.fresh) as journal:
            self.fresh = False
            yield journal

    def inputs(self, built: Built) -> str:
        """Hash of all that the points of an assembly depend on."""
        sweep = built.settings.sweep
        band = (sweep.start, sweep.stop, sweep.points) if self.whole_sweep else ()
        others = hashes_of(sources_of_others())
        code = hash_of_code(("case.run", "case.curves"))
        return store.fingerprint(checkpoint.of_points(built), hashes_of(self.modal_files), code, others, *band)
