"""Case control of a Nastran file: which subcase its modes are of, and under which loads they are.

Commands before the first SUBCASE are those of every subcase that has no such command itself. STATSUB names
the static subcase whose stresses the modes are under; SOL 106 takes them (PARAM,NMLOOP) about the end of
a subcase, with PARAM,LGDISP at finite displacements. Modes of other solutions are unloaded (Quick
Reference Guide, SUBCASE, STATSUB).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .bdf_cards import BulkLine
from .raw import PRESTRESSED, Damaged

_ALONE = {
    "LOAD",
    "SPC",
    "MPC",
    "STEP",
    "BCSET",
    "BGSET",
    "SUBCASE",
    "SUBCOM",
    "SYM",
    "SYMCOM",
    "SUBSEQ",
    "REPCASE",
}
_SHORT = {
    "TEMP": "TEMP",
    "METH": "METHOD",
    "CMET": "METHOD",
    "STATSUB": "STATSUB",
    "ANAL": "ANALYSIS",
}
"""First letters of a command -> what it is called here."""
_MATRICES = r"[KMB]2(GG|PP)|P2G|A2GG"
_NAMED = {
    "STATIC": 101,
    "SESTATIC": 101,
    "LINEARSTATIC": 101,
    "MODES": 103,
    "SEMODES": 103,
    "NONLINEARSTATIC": 106,
}
_OTHER_STEPS = (400, 401, 402, 601)


@dataclass(frozen=True)
class Case:
    """A subcase: command, with the word in brackets of temperatures -> what it says, where.

    Attributes:
        number: 0 of a file without subcases. own: commands that stand in it.
    """

    number: int
    place: str
    says: Mapping[str, tuple[str, str]]
    own: frozenset[str] = frozenset()

    def number_of(self, command: str) -> int | None:
        """Of the set that a command chooses, None if it chooses none.

        Raises:
            Damaged: it says no number.
        """
        if command not in self.says:
            return None
        text, place = self.says[command]
        if not re.fullmatch(r"\d{1,9}", text):
            raise Damaged(f"{place}: {command} = {text[:20]} is no number of a set; correct it")
        return int(text)

    def place_of(self, command: str) -> str:
        """Where a command stands."""
        return self.says[command][1]


@dataclass(frozen=True)
class Control:
    """What the case control of a file chooses.

    Attributes:
        there: whether the file has one. solution: number of SOL, 0 if unknown. cases: subcases, one at least.
        matrices: whether it adds matrices (K2GG and others).
    """

    there: bool
    solution: int
    cases: Sequence[Case]
    matrices: bool = False
    told: list[str] = field(default_factory=list)

    @property
    def modal(self) -> Case:
        """The subcase that the modes are of: the first that asks for them, else the first."""
        asking = [c for c in self.cases if c.says.get("ANALYSIS", ("",))[0].startswith("MODE")]
        asking += [c for c in self.cases if "METHOD" in c.own and c not in asking]
        if not asking and "METHOD" in self.cases[0].says:
            asking = [c for c in self.cases if "STATSUB" in c.says]
        return [*asking, *self.cases][0]

    def static(self, after_loops: bool, finite: bool) -> tuple[Case | None, bool, list[str]]:
        """The static subcase that the modes are about, whether at finite displacements, and what is said of it.

        Args:
            after_loops: PARAM,NMLOOP. finite: PARAM,LGDISP.

        Raises:
            Damaged: STATSUB names a subcase that is not there.
        """
        modal = self.modal
        number = modal.number_of("STATSUB")
        stepped = [c for c in self.cases if "STEP" in c.says and self.solution in _OTHER_STEPS]
        if stepped:
            return None, False, [f"{stepped[0].place}: SOL {self.solution}, STEP: {PRESTRESSED}"]
        if number is not None and self.solution != 105:
            there = next((c for c in self.cases if c.number == number), None)
            if there is None or there is modal:
                raise Damaged(
                    f"{modal.place_of('STATSUB')}: STATSUB = {number} names no other subcase of the file; correct it"
                )
            return there, False, []
        if self.solution == 106 and "METHOD" in modal.says and after_loops and finite:
            return modal, True, []
        return None, False, []


def control_of(lines: list[BulkLine], there: bool) -> Control:
    """The case control in the lines before the bulk data. there: whether these are marked by BEGIN BULK."""
    ends = (i for i, line in enumerate(lines) if re.match(r"\s*CEND\b", line.text))
    first = next(ends, -1) + 1
    solution = 0
    for line in lines[:first] or lines:
        if found := re.match(r"\s*SOL\b[\s=]*([^$,]*)", line.text):
            word = found[1].replace(" ", "")
            number = re.match(r"\d+", word)
            solution = int(number[0]) if number else _NAMED.get(word, 0)
    general: dict[str, tuple[str, str]] = {}
    cases, says, matrices = list[tuple[int, str, dict[str, tuple[str, str]]]](), general, False
    for line in lines[first:]:
        found = re.match(r"\s*([A-Z]\w*)\s*(\([^)]*\))?\s*=?\s*(.*)", line.text)
        if found is None:
            continue
        word, option, value = (
            found[1],
            (found[2] or "").strip("() "),
            found[3].split(",")[0].strip(),
        )
        matrices = matrices or bool(re.fullmatch(_MATRICES, word))
        command = (
            word
            if word in _ALONE
            else next((c for s, c in _SHORT.items() if word.startswith(s)), "")
        )
        if command in ("SUBCASE", "SUBCOM", "SYM", "SYMCOM", "SUBSEQ", "REPCASE"):
            number = re.match(r"\d{1,9}", value)
            says = {}
            cases.append(
                (int(number[0]) if number and command == "SUBCASE" else -1, line.place, says)
            )
        elif command == "TEMP":
            says[f"TEMP({option[:4] or 'BOTH'})"] = value, line.place
        elif command:
            says[command] = value, line.place
    made = [Case(n, place, general | own, frozenset(own)) for n, place, own in cases]
    return Control(
        there, solution, made or [Case(0, lines[0].place if lines else "", general)], matrices
    )
