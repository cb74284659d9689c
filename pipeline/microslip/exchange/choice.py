"""What a format can hold of a modal file: which group, in which coordinates, and what is said if it cannot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..data import Indices, ModalBasis, ModalGroup
from ..errors import UserError
from ..reduced.coordinates import in_modes, with_modes
from ..ring.resonances import speeds_of
from ..units import rpm_text


@dataclass(frozen=True)
class Format:
    """Another program's format.

    Attributes:
        name: as in ``--to``. ending: of the file's name if none is asked for. reader: who takes it. write: a
            `ModalBasis` and a path; it leaves the file complete or absent. warnings: what its reader may stumble over.
    """

    name: str
    ending: str
    reader: str
    write: Callable[[ModalBasis, Path], None]
    warnings: Callable[[ModalBasis], list[str]] = lambda _: []


STATEMENT = (
    "SI units (m, kg, s, N, rad, Pa), frequencies in Hz where so called; right-handed frame of the mesh; "
    "forces positive along their displacements"
)
"""What every file says of its units, frame and signs."""


def select(basis: ModalBasis, speed: int | None, nodal_diameter: int | None) -> ModalBasis:
    """The same body with the groups of one speed (counted from 0) and one nodal diameter; None keeps all.

    Raises:
        UserError: the file holds no such group.
    """
    speeds, harmonics = len(speeds_of(basis)), sorted({k for _, k in basis.groups})
    if speed is not None and not 0 <= speed < speeds:
        raise UserError(f"{basis.name}: --speed {speed}: the file has {speeds}; count from 0")
    if nodal_diameter is not None and nodal_diameter not in harmonics:
        known = ", ".join(map(str, harmonics))
        raise UserError(f"{basis.name}: --nodal-diameter {nodal_diameter}: the file has {known}; choose one of these")
    wanted = (speed, nodal_diameter)
    return replace(
        basis,
        groups={
            key: g
            for key, g in basis.groups.items()
            if all(w is None or w == k for w, k in zip(wanted, key, strict=True))
        },
    )


def only_group(basis: ModalBasis, form: str) -> ModalGroup:
    """The group of a file that holds one, for a format that holds one.

    Raises:
        UserError: there are several.
    """
    if len(basis.groups) > 1:
        speeds, harmonics = len(speeds_of(basis)), sorted({k for _, k in basis.groups})
        several = [f"--speed 0 to {speeds - 1}"] * (speeds > 1)
        several += [f"--nodal-diameter {harmonics[0]} to {harmonics[-1]}"] * (len(harmonics) > 1)
        raise UserError(f"{basis.name}: export --to {form}: the format holds one state; choose {' and '.join(several)}")
    return next(iter(basis.groups.values()))


def real(group: ModalGroup, form: str) -> ModalGroup:
    """The group, if its shapes are real.

    Raises:
        UserError: a sector at a nodal diameter between 0 and N/2.
    """
    numbers = [group.M_r, group.K_r, group.phi, *(i.rows for i in group.interfaces.values())]
    if any(np.iscomplexobj(a) for a in numbers):
        raise UserError(
            f"export --to {form}: nodal diameter {group.harmonic} has complex shapes, which the format cannot hold; "
            "choose --nodal-diameter 0 or N/2, or --to mat, mtx or uff"
        )
    return group


def with_shapes(basis: ModalBasis, group: ModalGroup, form: str) -> ModalGroup:
    """The group, if its shapes at the nodes are in the file.

    Raises:
        UserError: they were left out.
    """
    if len(group.phi) != basis.mesh.n_points or not basis.mesh.n_points:
        raise UserError(
            f"{basis.name}: export --to {form}: the modal file holds no shapes at the nodes; "
            "set shapes = true in [output] and compute it again"
        )
    return group


def whole_body(basis: ModalBasis, form: str) -> None:
    """Nothing, of a whole body.

    Raises:
        UserError: a cyclic sector.
    """
    if basis.sectors > 1:
        raise UserError(f"{basis.name}: export --to {form}: a cyclic sector is no whole body; mesh the whole body")


def whole_in_modes(basis: ModalBasis, g: ModalGroup, form: str) -> ModalGroup:
    """The group in its modes, if they are all it has.

    Raises:
        UserError: part of its flexibility stands in coordinates without mass, in forces or in residual shapes.
    """
    if len(g.omega) < g.n_modes or g.residual is not None:
        raise UserError(
            f'{basis.name}: export --to {form}: reduction = "{basis.reduction}" keeps flexibility beside the modes, '
            'which would be lost; compute it with reduction = "craig-bampton", "rubin" or "eigenmodes"'
        )
    return in_modes(g)


def body_in_motion(basis: ModalBasis, form: str) -> ModalGroup:
    """The one real group at rest in its elastic modes, with inertia integrals: what multibody programs take.

    Raises:
        UserError: a cyclic sector, a group at speed, several groups, no inertia integrals in the file, flexibility
            beside the modes, no elastic mode.
    """
    group = only_group(basis, form)
    whole_body(basis, form)
    if group.speed:
        raise UserError(
            f"{basis.name}: export --to {form}: the modes at {rpm_text(group.speed)} hold the stiffness "
            "of that speed, which a multibody program adds itself; export a group at rest (speeds_rpm = [0])"
        )
    if group.invariants is None:
        raise UserError(
            f"{basis.name}: export --to {form}: the file holds no inertia integrals, as measured modes and older files "
            "do; compute the body on a mesh"
        )
    return elastic(whole_in_modes(basis, real(group, form), form), form)


def elastic(g: ModalGroup, form: str) -> ModalGroup:
    """A group in its modes without the rigid ones, whose motion the moving frame has. Only what multibody needs is cut.

    Raises:
        UserError: nothing elastic remains.
    """
    keep = np.flatnonzero(g.omega > 0)
    if not len(keep):
        raise UserError(f"export --to {form}: the modal file holds rigid motions only; ask for more modes")
    some = np.ix_(keep, keep)
    assert g.invariants is not None
    if g.N_r is not None:
        raise UserError(f"export --to {form}: this format has no place for circulatory forces (N_r); use mat or mtx")
    return replace(
        g, omega=g.omega[keep], kind=tuple(g.kind[j] for j in keep), damping_ratio=g.damping_ratio[keep],
        M_r=g.M_r[some], K_r=g.K_r[some], C_r=g.C_r[some], G_r=g.G_r[some],
        phi=g.phi[:, :, keep] if len(g.phi) else g.phi,
        interfaces={n: replace(i, rows=i.rows[:, keep]) for n, i in g.interfaces.items()},
        monitors={n: replace(r, rows=r.rows[:, keep]) for n, r in g.monitors.items()},
        invariants=with_modes(g.invariants, keep),
    )  # fmt: skip


def one_line(text: str) -> str:
    """A text as one line of printable ASCII, for formats that know lines and nothing else."""
    plain = " ".join(text.split()).encode("ascii", "replace").decode("ascii")
    return "".join(c if c.isprintable() else "?" for c in plain)


def node_numbers(basis: ModalBasis) -> Indices:
    """(n,) numbers of the nodes: those of the mesh file, or counted from 1."""
    ids = basis.mesh.node_id
    return ids if len(ids) else np.arange(1, basis.mesh.n_points + 1)
