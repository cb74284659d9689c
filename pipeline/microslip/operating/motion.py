"""The steady motion of one body, and what its points do: displacement anywhere, monitors, gauges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..data import Array, ComplexArray, ModalBasis, ModalGroup, Residual, Rows
from ..errors import UserError


@dataclass(frozen=True)
class Part:
    """One harmonic of the motion, at f points of a sweep.

    Attributes:
        group: whose coordinates q are. q: (f, m) complex 0-peak amplitudes. forces: (f, r) amplitudes of the forces on
            the rows of the group's residual shapes, N, N m, or (f, 0). conjugate: read with the conjugate rows: the
            wave of a cyclic sector at a nodal diameter above N/2, k' = N - k of the file the other way round.
    """

    group: ModalGroup
    q: ComplexArray
    forces: ComplexArray
    conjugate: bool = False

    def read(self, rows: Array, beside: Array | None = None) -> ComplexArray:
        """(f, ...) amplitudes of what (..., m) rows read, with the residual's (..., r) where forces are given."""
        found = self._times(self.q, rows)
        if beside is not None and self.forces.shape[1]:
            found = found + self._times(self.forces, beside)
        return found.reshape(len(self.q), *rows.shape[:-1])

    def _times(self, q: ComplexArray, rows: Array) -> ComplexArray:
        flat = rows.reshape(-1, rows.shape[-1]).T
        if np.iscomplexobj(flat):
            return q @ (flat.conj() if self.conjugate else flat)
        found = np.empty((len(q), flat.shape[1]), dtype=complex)  # two real products are half the work of a complex one
        found.real, found.imag = q.real @ flat, q.imag @ flat
        return found


@dataclass(frozen=True)
class Motion:
    """u(t) = sum over h of Re(a_h exp(i h Omega t)), a_h = phi_h q_h, about the static state; a_0 is the mean.

    Attributes:
        Omega: (f,) rad/s. parts: H + 1 harmonics, the mean first.
    """

    Omega: Array
    parts: tuple[Part, ...]

    @property
    def count(self) -> int:
        """Points of the sweep."""
        return len(self.Omega)

    @property
    def harmonics(self) -> int:
        return len(self.parts) - 1

    def at(self, chosen: int | Sequence[int] | Array) -> Motion:
        """The motion at some points of the sweep."""
        i = np.atleast_1d(np.asarray(chosen))
        parts = [Part(p.group, p.q[i], p.forces[i], p.conjugate) for p in self.parts]
        return Motion(self.Omega[i], tuple(parts))

    def of(
        self, read: Callable[[ModalGroup], Array], beside: Callable[[Residual], Array] | None = None
    ) -> ComplexArray:
        """(f, H + 1, ...) harmonics of what rows read; read(group) -> (..., m), beside(residual) -> (..., r)."""
        found = []
        for p in self.parts:
            more = beside(p.group.residual) if beside is not None and p.group.residual is not None else None
            found.append(p.read(read(p.group), more))
        return np.stack(found, axis=1)


def motion_of(
    Omega: Array,
    q: Array,
    groups: ModalGroup | Sequence[ModalGroup],
    conjugate: Sequence[bool] = (),
    forces: Array | None = None,
) -> Motion:
    """The motion of coordinates q (f, H + 1, m), or (H + 1, m) at one frequency.

    Args:
        Omega: rad/s. groups: one for all harmonics, or one each. conjugate: see `Part`, for each harmonic.
            forces: (f, H + 1, r) on the rows of the residual shapes, see `Part`.

    Raises:
        UserError: as many columns of q as the groups have coordinates are needed.
    """
    q = np.asarray(q, dtype=complex)
    q = q[None] if q.ndim == 2 else q
    each = [groups] * q.shape[1] if isinstance(groups, ModalGroup) else list(groups)
    f = np.zeros((*q.shape[:2], 0), dtype=complex) if forces is None else np.asarray(forces, dtype=complex)
    f = f[None] if f.ndim == 2 else f
    for g in each:
        if g.n_modes > q.shape[2]:
            raise UserError(f"{q.shape[2]} coordinates of a body were given, its modal file has {g.n_modes}")
    turned = list(conjugate) or [False] * len(each)
    parts = [Part(g, q[:, h, : g.n_modes], f[:, h], turned[h]) for h, g in enumerate(each)]
    return Motion(np.atleast_1d(np.asarray(Omega, dtype=float)), tuple(parts))


def nearest_point(basis: ModalBasis, place: Sequence[float] | Array) -> tuple[int, float]:
    """The mesh point nearest to a place (3,), and how far it is, m."""
    away = np.linalg.norm(basis.mesh.points - np.asarray(place, dtype=float), axis=1)
    return int(away.argmin()), float(away.min())


def point_numbered(basis: ModalBasis, node: int) -> int:
    """The mesh point that has a number in the file the mesh came from.

    Raises:
        UserError: there is none.
    """
    found = np.flatnonzero(basis.mesh.node_id == node)
    if not len(found):
        raise UserError(f"{basis.name}: node {node}: the mesh has no such node")
    return int(found[0])


def displacement(motion: Motion, points: int | Sequence[int] | Array) -> ComplexArray:
    """(f, H + 1, p, 3) harmonics of the displacement of mesh points, m, body axes (of the sector in the file).

    Raises:
        UserError: the modal file holds no shapes.
    """
    i = np.atleast_1d(np.asarray(points))
    for p in motion.parts:
        if not len(p.group.phi):
            raise UserError(f"displacements: the modal file holds no shapes; {MORE.format('output.shapes')}")
    return motion.of(lambda g: g.phi[i], lambda r: r.phi[i])


MORE = "write it again with {} = true in body.toml"


def read_out(motion: Motion, name: str, kind: str = "monitors") -> ComplexArray:
    """(f, H + 1, r) harmonics of a monitor (m), an excitation's rows or a gauge (1), without the static reading.

    Args:
        kind: ``monitors``, ``gauges`` or ``excitations``.

    Raises:
        UserError: the modal file has none of that name.
    """

    def rows(g: ModalGroup) -> Array:
        held: dict[str, Rows] = dict(getattr(g, kind))
        if name not in held:
            raise UserError(f"{kind}: the modal file has no '{name}'; it has {', '.join(held) or 'none'}")
        return held[name].rows

    beside = {
        "gauges": lambda r: r.gauges[name],
    }.get(kind)
    return motion.of(rows, beside)
