"""What a case puts into its response file: the head that says what its points are of."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..contact.kinds import files_of as of_contact
from ..contact.kinds import sources_of_others
from ..contact.settings import ContactLaw, load_contact
from ..errors import UserError, in_its_file
from ..files.store import fingerprint
from ..harmonic_balance.checkpoint import restored
from ..harmonic_balance.response import traced
from ..operating.contact_maps import ContactMap, contact_map
from ..results import Body
from ..results.names import exact
from .assemble import Built
from .loaded import Loaded
from .problem import problem_of
from .settings import CaseSettings

MOST_MAPS = 4
"""Patches that are drawn."""


def without_defaults(raw: Mapping[str, Any]) -> dict[str, Any]:
    """A case file without the keys whose values are those they would have anyway."""
    fields = CaseSettings.model_fields
    return {k: v for k, v in raw.items() if k not in fields or v != fields[k].default}


def of_points(built: Built) -> str:
    """Hash of all that the points of a case depend on beside their frequency and the sweep's normal force.

    That is the balance itself, down to the last bit of its matrices, rows, loads and laws; what else the bodies hold is
    told by their files. For a contact that is fitted at the force of each sweep stands what fits it.
    """
    a, own = built.assembly, built.fitted
    as_they_are = [i for i in range(len(a.contacts)) if i not in own]
    rest = replace(a, contacts=tuple(a.contacts[i] for i in as_they_are))
    settings = tuple(built.contacts[i] for i in as_they_are)
    problem = problem_of(replace(built, assembly=rest, contacts=settings, fitted={}), None)
    components = tuple(replace(m, groups={}) for m in problem.assembly.components)
    fitted = [[built.contacts[i].model_dump(), a.contacts[i].first, a.contacts[i].second] for i in own]
    return fingerprint(replace(problem, assembly=replace(problem.assembly, components=components)), fitted)


def files_of(settings: CaseSettings) -> dict[str, Path]:
    """Name -> file of all that a case names, modal files left out, and of what is named there in turn."""
    folder = settings.path.parent
    found = {name: folder / name for name in settings.files}
    contacts: list[ContactLaw] = [*settings.contacts]
    for name in [c.file for c in settings.contacts if c.file is not None]:
        found |= {f"{name}: {own.name}": own for own in of_contact(folder / name)}
        with contextlib.suppress(UserError):  # told where the contact is made
            contacts.append(load_contact(folder / name))
    return found | sources_of_others(contacts)


def series_name(normal: float) -> str:
    """Name of the sweep under a normal force, N; another one for every other number."""
    return f"normal force {exact(normal)} N"


def head_of(
    built: Built, raw: Mapping[str, Any], hashes: Mapping[str, str], files: Mapping[str, str]
) -> dict[str, Any]:  # fmt: skip
    """Head of a case's journal and response file.

    Args:
        hashes, files: body of the case -> SHA-256 and name of its modal file.
    """
    s = built.settings
    bodies = {
        component: vars(_body(built, name, hashes[name], files[name]))
        for name in built.bodies
        for component in _standing(built, name)
    }
    return {
        "case": s.name, "description": s.description, "mode": s.mode, "settings": dict(raw), "bodies": bodies,
        "harmonics": s.balanced,
    }  # fmt: skip


@in_its_file
def as_found(settings: CaseSettings, folder: Path) -> CaseSettings:
    """A case with the number of harmonics that its response in a folder has, where it does not give one.

    Raises:
        UserError: there is no response.
    """
    if not settings.looks_for_harmonics:
        return settings
    try:
        return settings.with_harmonics(int(json.loads((folder / "response.json").read_text())["harmonics"]))
    except (OSError, ValueError, KeyError, TypeError):
        found_by = f'"auto" is found by microslip respond {settings.path}; run it first, or give a number'
        raise UserError(found_by, "harmonics") from None


def followed(settings: CaseSettings, raw: dict[str, Any], folder: Path) -> tuple[CaseSettings, dict[str, Any]]:
    """`as_found`, and the case as a table that says so."""
    found = as_found(settings, folder)
    if not settings.looks_for_harmonics:
        return found, raw
    own = {k: v for k, v in raw.items() if k != "harmonics_error"}
    return found, own | {"harmonics": found.harmonics, "samples": found.sampled}


def _standing(built: Built, name: str) -> list[str]:
    """Names under which a body stands in the assembly that is balanced, in coordinates of its modal file: N of a full
    ring, none of cyclic sectors that are joined there, whose coordinates are those of `system.disc`."""
    ring = built.settings.ring
    if ring is None or ring.model == "sector":
        return [name]
    return [] if _joined(built, name) else [f"{name}_{j}" for j in range(ring.blades)]


def _joined(built: Built, name: str) -> bool:
    ring = built.settings.ring
    return ring is not None and ring.model == "full" and built.bodies[name].basis.sectors > 1


def _body(built: Built, name: str, sha256: str, file: str) -> Body:
    b = built.bodies[name]
    harmonics = tuple(_wave(built, b, h) for h in range(built.settings.balanced + 1))
    speed = b.settings.speed if b.settings.speed_rpm is None else -1
    return Body(b.basis.name, sha256, file, speed, b.group.speed * 30 / np.pi, harmonics, b.has_residual)


def _wave(built: Built, b: Loaded, harmonic: int) -> tuple[int, bool]:
    """Nodal diameter of the group that a harmonic moves in, and whether its conjugate is meant."""
    if b.basis.sectors == 1:
        return min(b.groups), False
    index = built.assembly.index(harmonic)
    return (index, False) if index in b.groups else (b.basis.sectors - index, True)


def drawn_monitor(built: Built) -> tuple[str, str] | None:
    """Component and array name of the first read-out; None where the component's coordinates are not those of its
    file."""
    output = built.assembly.outputs[0]
    if _joined(built, output.component):
        return None
    component = _standing(built, output.component)[0]
    several = len(built.bodies) > 1 or component != output.component
    return component, f"{component}:{output.monitor}" if several else output.monitor


# contacts ----------------------------------------------------------------------------------------------------------


SAME_ENERGY = 1e-6
"""Share of a point's dissipated energy by which that of a contact may differ from map to response file: both are made
of the same numbers. Rounding of a sticking contact, which dissipates nothing, is counted against the work supplied."""


def maps_at(built: Built, normal: float, row: Mapping[str, Any]) -> list[ContactMap]:
    """The first patches of a case over the cycle of a point that a journal kept, as its force models see them.

    Raises:
        UserError: a map whose energy is not the one kept.
    """
    problem = problem_of(built, normal)
    _, found = restored(problem, dict(row))
    seen, maps = traced(problem, found), []
    for contact in problem.assembly.contacts[:MOST_MAPS]:
        component = next(m for m in problem.assembly.components if m.name == contact.first.component)
        side = next(iter(component.groups.values())).interfaces[contact.first.interface]
        force, c = seen[contact.name]
        what = c.taken, c.slipping, c.open, problem.harmonics, float(c.dissipated.sum())
        found_map = contact_map(contact.patch, side, np.asarray(force), *what, contact.phase)
        maps.append(replace(found_map, name=contact.name))
    _check_energy([c.name for c in problem.assembly.contacts], maps, row)
    return maps


def _check_energy(names: list[str], maps: list[ContactMap], row: Mapping[str, Any]) -> None:
    """That the maps of the first contacts tell the energy that the response file does, to `SAME_ENERGY`."""
    kept = [float(row[f"contacts/{name}/dissipated"]) for name in names]
    most = SAME_ENERGY * (sum(map(abs, kept)) + 1e-3 * abs(float(row["supplied"])))
    for name, found, energy in zip(names, maps, kept, strict=False):
        if not abs(found.work - energy) <= most:
            raise UserError(
                f"contact map of {name}: {found.work:.6g} J per cycle, where the response has {energy:.6g} J; no map "
                "is drawn: report it, the response itself is not touched by it"
            )
