"""Attacks a case: written down otherwise, interrupted, changed and changed back, its answer has to stay what it was.

    python tests/attack.py CASE.toml [SEED]

Works on copies. Prints by how much the products differ, as a share of the largest value of its kind, and ends with 1
where that is too much.
"""

from __future__ import annotations

import copy
import csv
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from answers import Answer, Change, Raw, answer, changed_bits, differences

from microslip.basis import read_basis, write_basis
from microslip.case import CaseSettings, load_case
from microslip.case.assemble import Built, build
from microslip.case.checkpoint import files_of
from microslip.contact.settings import load_contact
from microslip.data import Array
from microslip.errors import UserError
from microslip.results import read_journal
from microslip.settings.body import to_metres
from microslip.stages import places, running

SAME = 1e-6
"""Share of the largest value of a kind: answers are solved for to 1e-10 of the contacts' motion, from which a body
moves the more the softer it is against its contacts."""


# cases -------------------------------------------------------------------------------------------------------------


def toml(value: Any, top: bool = True) -> str:
    """TOML text of a table, everything in it on one line."""
    if isinstance(value, dict):
        each = [f"{json.dumps(k)} = {toml(v, False)}" for k, v in value.items()]
        return "".join(f"{line}\n" for line in each) if top else f"{{{', '.join(each)}}}"
    if isinstance(value, list | tuple | np.ndarray):
        return f"[{', '.join(toml(v, False) for v in value)}]"
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    return repr(value.item() if isinstance(value, np.generic) else value)


@dataclass(frozen=True)
class Case:
    """A case to be copied: its file's table, the modal files of its bodies, and the files that it names beside it."""

    raw: Raw
    settings: CaseSettings
    bodies: dict[str, Path]
    beside: dict[str, Path]

    def copied(self, folder: Path, raw: Raw | None = None) -> Path:
        """A folder in which the case is answered, perhaps written otherwise."""
        for name, file in {**self._modal(), **self.beside}.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, folder / name)
        (folder / "case.toml").write_text(toml(raw or self.raw), encoding="utf-8")
        return folder

    def _modal(self) -> dict[str, Path]:
        alone = len(self.settings.components) == 1
        return {b.file or ("basis.h5" if alone else f"build/{b.body or b.name}/basis.h5"): self.bodies[b.name]
                for b in self.settings.components}  # fmt: skip

    @property
    def inputs(self) -> list[str]:
        """Names of all files of a copy."""
        return ["case.toml", *self._modal(), *self.beside]

    @property
    def built(self) -> Built:
        return build(self.settings, {n: read_basis(f) for n, f in self.bodies.items()})


def opened(path: Path, assignments: list[str] | None = None, root: Path = Path(".")) -> Case:
    """A case with the modal files that are there, or are made now."""
    settings, raw = load_case(path, assignments)
    try:
        files = places.existing_files(settings, None, root)
    except UserError:
        files = places.modal_files(settings, root, lambda text: print(f"  {text}", file=sys.stderr))
    beside = {os.path.relpath(f, path.parent): f for f in files_of(settings).values()}
    case = Case(raw, settings, files, beside)
    if outside := [name for name in case.inputs if name.startswith(("..", "/"))]:
        raise UserError(f"{path}: {outside[0]} does not stand below the folder of the case; copy it there")
    return case


def responded(folder: Path, assignments: list[str] | None = None, force: bool = False) -> Answer:
    """The answer of a copy."""
    running.respond(folder / "case.toml", None, assignments, force, root=folder)
    return answer(folder / "build" / load_case(folder / "case.toml")[0].name)


# other ways of writing it --------------------------------------------------------------------------------------------


def shuffled(raw: Raw, rng: np.random.Generator) -> Raw:
    """Bodies, contacts and loads in another order, read-outs too but for the first, which is drawn."""
    out = copy.deepcopy(raw)
    for key in {"bodies", "contacts", "excitations", "monitors"} & {*out}:
        fixed = 1 if key == "monitors" else 0
        out[key] = out[key][:fixed] + [out[key][fixed:][i] for i in _moved(len(out[key]) - fixed, rng)]
    return out


def _moved(count: int, rng: np.random.Generator) -> list[int]:
    """Another order of so many things, if there is one."""
    order = rng.permutation(count).tolist()
    return order if order != sorted(order) or count < 2 else order[::-1]


def exchangeable(case: Case) -> list[int]:
    """Contacts of two equal faces that lie centred on each other, tangents along tangents, and move rigidly: what is
    asked of them (stiffnesses along t1, points along t2) then means the same from either side."""
    built, found = case.built, []
    whole = case.settings.ring is not None and case.settings.ring.model == "full"
    for i, c in enumerate(built.assembly.contacts):
        if c.second is None or c.second.rows is not None or whole:
            continue
        one, two = (built.bodies[s.component].group.interfaces[s.interface] for s in (c.first, c.second))
        size = max(one.extent.max(), 1e-3)
        turned, arm = np.abs(np.diag(c.second.frame)[:3]), np.abs(c.second.frame[:3, 3:]).max()
        area = abs(c.patch.areas.sum() - np.prod(one.extent)) < 1e-2 * np.prod(one.extent) or not one.extent.all()
        alike = np.allclose(one.extent, two.extent, rtol=1e-6) and np.allclose(turned, 1.0, atol=1e-9)
        found += [i] * bool(alike and area and arm < 1e-6 * size)
    return found


def exchanged(case: Case, which: list[int]) -> tuple[Raw, Change]:
    """The case with the faces of some contacts named the other way round, and what becomes of its arrays.

    With the motion d = u_1 - F u_2 of two faces, F the frame of the second seen from the first, the other way round it
    is -F^-1 d, and the force -F^T f does the same work on it.
    """
    raw, contacts, become = copy.deepcopy(case.raw), case.built.assembly.contacts, {}
    ring = case.built.assembly.ring
    for i in which:
        c = raw["contacts"][i]
        lag = 2 * np.pi * contacts[i].second.shift * ring.order / ring.blades if ring else 0.0
        become[c["interface"]] = c["against"], contacts[i].second.frame, lag
        c["interface"], c["against"] = c["against"], c["interface"]
        if c.get("against_sector"):
            c["against_sector"] *= -1
    return raw, lambda name, values: _from_the_other_side(name, values, become)


def _from_the_other_side(name: str, values: Array, become: dict[str, tuple[str, Array, float]]) -> tuple[str, Array]:
    kind, _, rest = name.partition("/")
    contact, _, what = rest.rpartition("/")
    if kind != "contacts" or contact not in become:
        return name, values
    other, frame, lag = become[contact]
    if values.ndim == 3:
        turned = -np.linalg.inv(frame) if what == "displacement" else -frame.T
        values = later(np.einsum("kl,flw->fkw", turned, values), lag)
    return f"{kind}/{other}/{what}", values


def later(values: Array, lag: float) -> Array:
    """Harmonics (..., W) mean, cos, sin, ... of what happens later by an angle of the first harmonic, rad."""
    out = values.copy()
    h = np.arange(1, values.shape[-1] // 2 + 1)
    amplitude = (values[..., 1::2] - 1j * values[..., 2::2]) * np.exp(-1j * h * lag)
    out[..., 1::2], out[..., 2::2] = amplitude.real, -amplitude.imag
    return out


def in_millimetres(folder: Path) -> bool:
    """Write every contact.toml and every .csv of a pressure field of a copy in mm; whether there is any."""
    settings, raw = load_case(folder / "case.toml")
    files = {c.file for c in settings.contacts if c.file}
    for name in files:
        found = load_contact(folder / name)
        if getattr(found.roughness, "kind", "") == "table":
            return False  # lengths stand in a further file
        told = to_metres(found, 1e3).model_dump(exclude_unset=True, exclude_none=True)
        (folder / name).write_text(toml(told | {"length_unit": "mm"}))
    for x in raw.get("excitations", []):
        if x.get("length_unit") == "m" and x["field"].endswith(".csv") and x["field"] not in files:
            head, *rows = csv.reader((folder / x["field"]).read_text().splitlines())
            each = [[repr(1e3 * float(v)) if n in "xyz" else v for n, v in zip(head, r, strict=True)] for r in rows]
            (folder / x["field"]).write_text("\n".join(",".join(r) for r in [head, *each]) + "\n")
            files.add(x["field"])
            x["length_unit"] = "mm"
    (folder / "case.toml").write_text(toml(raw))
    return bool(files)


# interrupted and changed --------------------------------------------------------------------------------------------


def interrupted(folder: Path, after: int, wait: float) -> int:
    """The command in a process of its own, asked to end (SIGTERM) so many s after so many points; its exit code."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "microslip", "respond", "case.toml", "-q"]
    process = subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.DEVNULL)
    (name,) = {load_case(folder / "case.toml")[0].name}
    while process.poll() is None and _kept(folder / "build" / name / "response.points") < after:
        time.sleep(0.01)
    time.sleep(wait)
    process.send_signal(signal.SIGTERM)
    return process.wait()


def _kept(points: Path) -> int:
    try:
        return sum(len(s) for s in read_journal(points)[1].values())
    except UserError:
        return 0


def spoilt(file: Path) -> bytes:
    """Change a file so that the answer is another one; what it held.

    A modal file: damping 1 % more. A case: a load 1 % larger. Any other text: the last of its numbers.
    """
    held = file.read_bytes()
    if file.suffix == ".h5":
        basis = read_basis(file)
        more = {k: replace(g, C_r=1.01 * g.C_r, damping_ratio=1.01 * g.damping_ratio) for k, g in basis.groups.items()}
        write_basis(file, replace(basis, groups=more))
    elif file.name == "case.toml":
        _, raw = load_case(file)
        load = (raw.get("excitations") or [raw])[0]
        key = next((k for k in ("amplitude", "steady") if k in load), "amplitude")
        load[key] = 1.01 * load.get(key, 1.0)
        file.write_text(toml(raw), encoding="utf-8")
    else:
        found = re.findall(r"(?s)^(.*[\s,=\[])([0-9][0-9.]*(?:[eE][-+]?[0-9]+)?)(.*)$", held.decode())
        before, number, rest = found[0]
        file.write_text(f"{before}{1.01 * float(number)!r}{rest}")
    return held


# all of it ---------------------------------------------------------------------------------------------------------


def attack(
    path: Path, seed: int = 0, assignments: list[str] | None = None, root: Path = Path(".")
) -> Iterator[tuple[str, float]]:  # fmt: skip
    """What was tried, and by how much the answer differs at most; by inf where not all bits are the same that must be.

    Args:
        assignments: as of ``--set``. root: where the case is run otherwise, with its ``build/``.
    """
    rng, case = np.random.default_rng(seed), opened(path, assignments, root)
    with tempfile.TemporaryDirectory(prefix="attack-") as name:
        folder = Path(name)
        plain = responded(case.copied(folder / "plain"))
        yield "in another order", far(plain, responded(case.copied(folder / "order", shuffled(case.raw, rng))))
        if which := exchangeable(case):
            raw, change = exchanged(case, which)
            other = responded(case.copied(folder / "sides", raw))
            yield f"sides of contacts exchanged: {len(which)}", far(plain, other, change)
        if in_millimetres(case.copied(folder / "mm")):
            yield "files beside it in mm", far(plain, responded(folder / "mm"))
        points = sum(len(s.key) for s in plain.response.series)
        at = case.copied(folder / "interrupted")
        code = interrupted(at, int(rng.integers(1, points)), float(rng.uniform(0, 0.2)))
        left = f"interrupted with exit code {code} and resumed" if code > 1 else "ended before it was interrupted"
        yield left, far(plain, responded(at))
        for name in case.inputs:
            file = folder / "plain" / name
            held = spoilt(file)
            other = responded(folder / "plain")
            file.write_bytes(held)
            bits = changed_bits(plain, responded(folder / "plain"))
            moved = "" if changed_bits(plain, other) else " (the answer did not change)"
            yield (
                f"{name} changed{moved} and restored" + ", ".join([":"] * bool(bits) + bits),
                math.inf if bits else 0.0,
            )


def far(a: Answer, b: Answer, *change: Change) -> float:
    """The largest of the `differences`."""
    return max(differences(a, b, *change).values())


def main(words: list[str]) -> int:
    """Attack a case and say what came of it; 1 if its answer depends on what it may not depend on."""
    if not 1 <= len(words) <= 2:
        print(__doc__, file=sys.stderr)
        return 2
    worst = 0.0
    for what, apart in attack(Path(words[0]), *map(int, words[1:])):
        print(f"{apart:8.1e}  {what}", flush=True)
        worst = max(worst, apart)
    return int(not worst <= SAME)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
