"""What the page of a modal file says."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basis import check_basis
from ..data import ModalBasis, ModalGroup
from ..linalg.gyroscopic import stability_sentence
from ..modal.campbell import crossings, engine_orders, parted, track_basis
from ..modal.stress import static_extremes
from ..reduced.compliance import SUPPLIED, Share, has_residual, sentence, shares
from ..reduced.coordinates import basis_in_modes
from ..reduced.quality import sentences
from ..reduced.truncation import percent, verdict
from ..ring.expansion import certificate_words, certify_ring, ring_checks
from ..ring.resonances import eigenmodes, harmonics_of, speeds_of
from ..units import METRES, rpm_text, to_rpm
from . import ring
from .page import Album, Piece, fold, number, page, say, table
from .response import answer, response_pieces, warnings
from .words import (
    certificate,
    contact_sentence,
    counted_modes,
    fit_sentence,
    fit_summary,
    hertz,
    number_list,
    range_sentence,
)


def report_html(
    basis: ModalBasis, pictures: Mapping[str, Path], messages: Sequence[str] = (),
    response: Mapping[str, Any] | None = None,
) -> str:  # fmt: skip
    """The page of a body.

    Args:
        basis: what it is about. pictures: name -> file, the names of `pictures.draw_all`; others are shown with
            the response. messages: sentences that a reader must know. response: a summary of a case, name -> text,
            number, list of numbers or list of rows (each a mapping of the same names).
    """
    stored, basis = basis, basis_in_modes(basis)
    album, cyclic = Album(pictures), basis.sectors > 1
    answered = answer(response, album) if response is not None else []
    sections = {
        "Engine orders": ring.orders(basis, album) if cyclic else [],
        "Frequencies": ring.frequencies(basis, album) if cyclic else _frequencies(basis, album),
        "Body": [table((), _facts(basis)), album.take("mesh")],
        "Modes": _modes(basis, album),
        "Stresses": [album.take("stress_modes", tone="wide"), _static(basis), album.take("static")],
        "Interfaces": _interfaces(basis, album),
        "Static contact": _contacts(basis, album),
        "How many modes are enough": _truncation(stored, basis, album),
        "Compliance counted once": _counted_once(stored),
        "Loads and read-outs": [_rows(basis)],
        "Checks": _checks(basis),
        "Provenance": _provenance(basis),
    }
    sections = {"Friction response": response_pieces(response or {}, album), **sections}
    about = say(_lead(basis), tone="" if response else "lead")
    first = [about, warnings(messages)] if response is None else [*answered, warnings(messages), about]
    return page(f"{basis.name}: {'modal basis' if response is None else 'friction response'}", first, sections)


def _groups(basis: ModalBasis) -> list[ModalGroup]:
    return [basis.groups[k] for k in sorted(basis.groups)]


def _static(basis: ModalBasis) -> Piece:
    """The largest displacement and stress of every static state at speed."""
    said = []
    for group in {g.speed: g for g in reversed(_groups(basis))}.values():
        moved, stress = static_extremes(group)
        stressed = f", equivalent stress up to {number(1e-6 * stress)} MPa" if np.isfinite(stress) else ""
        if moved > 0:
            said.append(f"Static state at {rpm_text(group.speed)}: displacement up to {METRES.sized(moved)}{stressed}.")
    return say(*said[::-1])


def _clean(values: Any, scale: float) -> Any:
    """Rounding rests set to zero."""
    return np.where(np.abs(values) < 1e-9 * scale, 0.0, values)


def _list(values: Any, digits: int = 4) -> str:
    return ", ".join(number(float(v), digits) for v in values)


def _place(point: Any, basis: ModalBasis) -> str:
    """x, y, z in mm."""
    return _list(1e3 * _clean(point, float(np.abs(basis.mesh.points).max())))


def _lead(basis: ModalBasis) -> str:
    group, count = _groups(basis)[0], len(speeds_of(basis))
    speeds = f" at each of {count} speeds" if count > 1 else ""
    if basis.sectors > 1:
        modes = eigenmodes(group)
        return (
            f"Ring of {basis.sectors} sectors, {len(harmonics_of(basis))} nodal diameters with {modes.n_modes} modes "
            f"each from {modes.frequency[0]:.5g} Hz{speeds}; mass of a sector {number(basis.mass)} kg. "
            f"Proved: {certificate_words(certify_ring(basis))}."
        )
    elastic = group.frequency[group.omega > 0]
    band = f" from {elastic[0]:.5g} Hz to {elastic[-1]:.5g} Hz" if len(elastic) else ""
    rigid = int((group.omega == 0).sum())
    free = f", {rigid} of them rigid" if rigid else ""
    which = f"{counted_modes(group)}{free}{band}{speeds}"
    return f"{which}; mass {number(basis.mass)} kg. {certificate(group)}"


def _facts(basis: ModalBasis) -> list[tuple[str, str]]:
    mesh, held = basis.mesh, number_list(harmonics_of(basis))
    cells = ", ".join(f"{len(c)} {kind}" for kind, c in mesh.cells.items()) or "no cells"
    inertia = _clean(basis.inertia, float(np.abs(basis.inertia).max()))
    alike = f"one of {basis.sectors} alike round the axis; all numbers here are of one; nodal diameters {held}"
    if not mesh.n_points:
        return [("coordinates", "of matrices without nodes"), ("damping given as", basis.damping_source)]
    facts = {
        "mass": f"{number(basis.mass, 6)} kg",
        "sector": alike if basis.sectors > 1 else "",
        "size along x, y, z": " × ".join(map(number, np.ptp(mesh.points, axis=0) * 1e3)) + " mm",
        "centre of mass x, y, z": _place(basis.centre, basis) + " mm",
        "inertia about the centre xx, yy, zz": _list(inertia[[0, 1, 2], [0, 1, 2]]) + " kg m²",
        "xy, yz, xz": _list(inertia[[0, 1, 0], [1, 2, 2]]) + " kg m²",
        "mesh": f"{mesh.n_points} points, {cells}, {3 * mesh.n_points} degrees of freedom",
        "held": "rigid motions are left free" if basis.free else "by its supports",
        "damping given as": basis.damping_source,
        "reduction": basis.reduction,
        "material": _material(basis.provenance),
        "rotation": _rotation(basis),
    }
    return [(name, value) for name, value in facts.items() if value]


def _material(provenance: Mapping[str, str]) -> str:
    """In words if the settings travel with the file, else as it says."""
    try:
        found = json.loads(provenance.get("settings", "{}")).get("material", {})
        words = [f"density {found['density']:.9g} kg/m³"] if "density" in found else []
        words += [f"E = {_list(np.atleast_1d(found['young']) / 1e9, 6)} GPa"] if "young" in found else []
        words += [f"nu = {found['poisson']}"] if "poisson" in found else []
    except (ValueError, AttributeError, TypeError):
        words = []
    return ", ".join([str(found.get("name", "material")), *words]) if words else provenance.get("material", "")


def _rotation(basis: ModalBasis) -> str:
    last = _groups(basis)[-1]
    if not any(g.speed for g in _groups(basis)):
        return ""
    stress = {"nonlinear": "nonlinear equilibrium", "linear": "linear prestress", "none": "no prestress"}
    how, softening = stress.get(last.prestress, last.prestress), "with" if last.spin_softening else "without"
    axis, point = _list(basis.rotation_axis), _list(1e3 * basis.rotation_point)
    return f"about ({axis}) through ({point}) mm; {how}, {softening} spin softening"


def _frequencies(basis: ModalBasis, album: Album) -> list[Piece]:
    groups = _groups(basis)
    several = len(groups) > 1
    proofs = [(f"{rpm_text(g.speed)}: " if several else "") + certificate(g) for g in groups]
    certified = all(g.checks.get("certified") for g in groups)
    rows = []
    for j in range(max(g.n_modes for g in groups)):
        cells = ["0" if j < g.n_modes and not g.omega[j] else hertz(g.frequency, j) for g in groups]
        first = next(g for g in groups if j < g.n_modes)
        rows.append([j + 1, *cells, number(100 * first.damping_ratio[j]), first.kind[j]])
    head = ["mode", *(f"Hz at {rpm_text(g.speed)}" if several else "Hz" for g in groups), "damping in %", "kind"]
    return [
        say(*proofs, tone="note" if certified else "warn"),
        table(head, rows),
        say(*(f"{w[:1].upper()}{w[1:]}." for w in sentences(groups[0], basis.reduction))),
        *_campbell(basis, album),
        *(piece for g in groups for piece in _gyroscopic(g)),
    ]


def _gyroscopic(group: ModalGroup) -> list[Piece]:
    """Frequencies with gyroscopic coupling, and whether the body is stable."""
    if (y := group.gyroscopic) is None:
        return []
    at = rpm_text(group.speed)
    bounds = [f"{100 * e:.2g} %" if np.isfinite(e) else "" for e in y.error]
    rows = [
        [i + 1, f"{f:#.6g}", way, f"{s:+.2f}", bound]
        for i, (f, way, s, bound) in enumerate(zip(y.frequency, y.direction, y.sense, bounds, strict=True))
    ]
    head = ["mode", "Hz", "direction", "sense of the orbits", "too high by at most"]
    return [
        say(f"{at}: {stability_sentence(y)}", tone="" if y.stable else "bad"),
        fold(f"Modes with gyroscopic coupling at {at}, in the rotating frame", table(head, rows)),
    ]


def _campbell(basis: ModalBasis, album: Album) -> list[Piece]:
    tracks = track_basis(basis)
    if tracks is None:
        return []
    met, coupled = tracks, ""
    if (split := parted(basis)) is not None:
        met, coupled = split, ", with gyroscopic coupling, in the rotating frame"
    rows = [
        [c.order, int(met.modes[c.curve][met.modes[c.curve] >= 0][0]) + 1]
        + [f"{to_rpm(c.speed):.0f}", f"{c.frequency:.5g}"]
        for c in crossings(met, engine_orders(basis))
    ]
    return [
        Piece("paragraph", "campbell"),
        say(*(range_sentence(k, r) for k, r in sorted(basis.ranges.items()))),
        album.take("campbell"),
        fold(f"Where engine orders meet modes{coupled}", table(["engine order", "mode", "rpm", "Hz"], rows)),
    ]


def _modes(basis: ModalBasis, album: Album) -> list[Piece]:
    sheets = [*album.begun("modes_", tone="wide"), *album.begun("ring_modes_", tone="wide")]
    if any(sheet.body for sheet in sheets):  # a mode can be chosen there, and moves
        album.drop("ring_wave_", "animation_", "mode_")
        return sheets
    moving = [Piece("row", album.begun(prefix)) for prefix in ("ring_wave_", "animation_")]
    single = []
    for group in _groups(basis):
        at = rpm_text(group.speed)
        of = f" of nodal diameter {group.harmonic}" if basis.sectors > 1 else ""
        shown = Piece("row", album.begun("mode_", "_" + at.replace(" ", "")))
        single.append(fold(f"Each mode{of} at {at}", shown))
    return [*sheets, *moving, *single]


def _interfaces(basis: ModalBasis, album: Album) -> list[Piece]:
    group = _groups(basis)[0]
    if not group.interfaces:
        return []
    rows = []
    for name, i in group.interfaces.items():
        role = i.role + (f", faces {i.partner}" if i.partner else "")
        normal = _list(_clean(i.rotation[0], 1.0), 3)
        rows.append([name, role, number(1e6 * i.area), len(i.areas), _place(i.origin, basis), normal])
    head = ["interface", "role", "area in mm²", "points", "origin in mm", "outward normal"]
    contacts = {name: i for name, i in group.interfaces.items() if i.role != "load"}
    fit = say(*(fit_sentence(name, i, group) for name, i in contacts.items()))
    return [
        table(head, rows),
        album.take("interfaces"),
        Piece("h3", "Do the patches move as rigid ones?" if contacts else ""),
        *([fit] if len(contacts) <= 4 else [say(fit_summary(contacts)), fold("Each patch", fit)]),
    ]


def _contacts(basis: ModalBasis, album: Album) -> list[Piece]:
    """Closures over the speeds; the nodal diameters share one static state."""
    states = {g.speed: g.contacts for g in reversed(_groups(basis))}
    closures = [(rpm_text(speed), name, c) for speed in sorted(states) for name, c in states[speed].items()]
    if not closures:
        return []
    rows = []
    for at, name, c in closures:
        pressed = number(c.normal_force), number(1e-6 * c.pressure.max(initial=0.0)), percent(c.closed_share)
        gaps = number(1e6 * c.gap.min(initial=0.0)), number(1e6 * c.gap.max(initial=0.0))
        rows.append([name, at, *pressed, _place(c.centre, basis), *gaps])
    head = ["contact", "speed", "normal force in N", "highest pressure in MPa", "area in contact", "centre in mm"]
    return [
        table([*head, "least gap in µm", "widest gap in µm"], rows),
        album.take("closure"),
        fold("In words", say(*(f"{at}: {contact_sentence(name, c)}" for at, name, c in closures))),
    ]


def _truncation(stored: ModalBasis, basis: ModalBasis, album: Album) -> list[Piece]:
    group = _groups(basis)[0]
    found = verdict(group, has_residual(_groups(stored)[0], basis.reduction), basis.sectors)
    if not found.coordinates:
        return [say(found.sentence, tone="note")]
    rows = [
        [c.label, f"{number(c.static)} {c.unit}", percent(c.share), f"{number(c.residual)} {c.unit}"]
        + [str(c.modes_for(s) or "more") for s in (0.9, 0.99)]
        for c in found.coordinates
    ]
    head = ["coordinate", "static compliance", "held by the modes", "left out", "modes for 90 %", "modes for 99 %"]
    return [
        say(found.sentence, tone="note"),
        say(*found.messages),
        Piece("paragraph", "inertia relief" if group.compliance.inertia_relief else ""),
        fold("Every coordinate", table(head, rows)),
        album.take("compliance"),
    ]


def _counted_once(basis: ModalBasis) -> list[Piece]:
    """Per interface coordinate: what the basis holds, what is left to a contact law, what must not be in it."""
    group = _groups(basis)[0]
    found = shares(group, basis.reduction, basis.sectors)
    if not found:
        return []
    solver = basis.reduction in SUPPLIED
    head = ["coordinate", "unit", "static", "basis holds", *(["solver adds"] if solver else [])]
    head += ["left to the law", "as a spring", "not in the law"]
    return [
        say(sentence(basis, group), tone="note"),
        table(head, [_share_row(s, solver) for s in found if s.kind == "squeeze"]),
        Piece("paragraph", "counted once"),
        fold("Each interface coordinate", table(head, [_share_row(s, solver) for s in found])),
    ]


def _share_row(s: Share, solver: bool) -> list[str]:
    amounts = [s.static, s.held, *([s.supplied] if solver else []), s.left, s.beyond]
    *held, left, beyond = [number(a) if a else "nothing" for a in amounts]
    spring = f"{number(s.law_stiffness)} {'N m/rad' if s.kind == 'rotation' else 'N/m'}" if s.left else ""
    return [s.label, s.unit, *held, left, spring, beyond]


def _rows(basis: ModalBasis) -> Piece:
    """Loads, monitors and gauges."""
    group = _groups(basis)[0]
    out = []
    for kind, named in (("excitation", group.excitations), ("monitor", group.monitors), ("gauge", group.gauges)):
        for name, rows in named.items():
            off = number(rows.distance * 1e3, 3) if rows.distance > 1e-9 else "0"
            out.append([kind, name, " ".join(rows.labels), rows.unit, _place(rows.point, basis), off])
    return table(["kind", "name", "rows", "unit", "at, in mm", "mm off the body"], out)


def _checks(basis: ModalBasis) -> list[Piece]:
    found = [*check_basis(basis), *ring_checks(basis)]
    failed = [c.name for c in found if not c.passed]
    rows = [
        [c.name, number(c.value, 3), number(c.limit, 3), "passed" if c.passed else "failed", c.message] for c in found
    ]
    every = table(["check", "value", "limit", "", "message"], rows)
    if failed:
        return [say(f"{len(failed)} of {len(found)} checks failed: {'; '.join(failed)}.", tone="bad"), every]
    return [say(f"All {len(found)} checks of the file passed.", tone="note"), fold("Every check", every)]


def _provenance(basis: ModalBasis) -> list[Piece]:
    short = [(k, v) for k, v in sorted(basis.provenance.items()) if 0 < len(v) <= 80]
    long = [fold(k, Piece("verbatim", v)) for k, v in sorted(basis.provenance.items()) if len(v) > 80]
    return [table((), short), *long]
