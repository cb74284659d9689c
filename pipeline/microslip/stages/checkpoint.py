"""The points of a case that are finished, kept while it runs, so that it goes on where it was."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..case import CaseSettings, checkpoint
from ..case.assemble import Built
from ..contact.kinds import sources_of_others
from ..errors import UserError
from ..files import store
from ..results import Journal, open_journal, read_journal
from ..results.journal import answers
from ..units import counted
from .stage import hash_of_code


def hashes_of(files: Mapping[str, Path]) -> dict[str, str]:
    """Name -> hash of files; what is missing is told where it is read."""
    return {name: store.hash_file(file) for name, file in files.items() if file.is_file()}


def inputs_of(
    raw: Mapping[str, Any], settings: CaseSettings, modal_files: Mapping[str, Path]
) -> dict[str, Any]:  # fmt: skip
    """What an answer to a case depends on: the case without the keys that say nothing, and hashes of its files."""
    return {
        "case": checkpoint.without_defaults(raw),
        "basis": hashes_of(modal_files),
        "files": hashes_of(checkpoint.files_of(settings)),
    }


@dataclass
class Checkpoint:
    """Where the finished points of a case are kept: `journal` opens its file.

    Attributes:
        file: the journal. raw: the case file. modal_files: body of the case -> its modal file. fresh: forget what is
            there. begin: is called before anything is written. whole_sweep: the points depend on the sweep that they
            are points of, as where a motion may be one of several. report: is told why points of a run that did not
            end are not gone on with; None: nobody is. opened: whether points are kept by now.
    """

    file: Path
    raw: Mapping[str, Any]
    modal_files: Mapping[str, Path]
    fresh: bool
    begin: Callable[[], None]
    whole_sweep: bool = False
    report: Callable[[str], None] | None = None
    opened: bool = False

    @contextlib.contextmanager
    def journal(self, built: Built) -> Iterator[Journal]:
        """The journal of an assembly; see `results.open_journal`."""
        names = {body: str(file) for body, file in self.modal_files.items()}
        head = checkpoint.head_of(built, self.raw, hashes_of(self.modal_files), names) | {"finished": False}
        parts = self._parts(built)
        self._tell(parts)
        self.begin()
        with open_journal(self.file, store.fingerprint(parts), head | {"made_of": parts}, self.fresh) as journal:
            self.fresh, self.report, self.opened = False, None, True
            yield journal

    def inputs(self, built: Built) -> str:
        """Hash of all that the points of an assembly depend on."""
        return store.fingerprint(self._parts(built))

    def _parts(self, built: Built) -> dict[str, str]:
        """What the points depend on, in words -> its hash."""
        sweep, others = built.settings.sweep, hashes_of(sources_of_others(built.contacts))
        band = {"the sweep": store.fingerprint(sweep.start, sweep.stop, sweep.points)} if self.whole_sweep else {}
        return {
            "the case": checkpoint.of_points(built), **band, "microslip": hash_of_code(("case.run", "case.curves")),
            **{f"the modal file of {name}": own for name, own in hashes_of(self.modal_files).items()},
            **{f"the module {name}": own for name, own in others.items()},
        }  # fmt: skip

    def _tell(self, parts: Mapping[str, str]) -> None:
        """What has changed since a run that did not end kept points, which are forgotten."""
        if self.report is None or self.fresh:
            return
        with contextlib.suppress(UserError):  # none is there
            head, series = read_journal(self.file)
            known, count = head.get("made_of", {}), sum(map(len, answers(head, series).values()))
            changed = [name for name in {**parts, **known} if parts.get(name) != known.get(name)]
            if known and count and changed:
                why = f"changed since: {', '.join(changed)}"
                self.report(f"warning: begins anew, without {counted(count, 'point')} of a run that did not end; {why}")
