"""Small systems by hand: point masses, rigid bodies, springs and dampers, or M, C, K, as a `ModalBasis`.

    M x'' + C x' + K x = f

A system has components, each with the directions it is free to move in; links between them; and named contacts, forces
and monitors on them, as a body of finite elements has. `System.basis` returns all its modes, so nothing is truncated,
and whatever reads a modal file goes on from there. SI throughout. `settings` reads the same from a file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from ..data import INTERFACE_ROWS, Array, Compliance, Interface, Mesh, ModalBasis, ModalGroup, Rows
from ..errors import UserError
from ..frames import skew
from ..linalg.canonical import signs, turn_clusters
from ..settings.mistakes import bounded
from ..settings.numbers import (
    damping_ratio,
    has_length,
    named_once,
    not_too_large,
)

GROUND = "ground"
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_RIGID = 1e-11
"""Eigenvalue over the largest one below which a mode counts as rigid: rounding of a dense eigensolution leaves some
1e-15 times the number of coordinates there."""


@dataclass(frozen=True)
class Body:
    """A component: a point mass, or a rigid body if it has inertia.

    Attributes:
        name: of the component. mass: kg. at: (3,) centre of mass, m. inertia: (3,) or (3, 3) about it, body axes, kg
            m2; None: a point, which does not turn. free: directions it can move in, e.g. ``x`` or ``x z ry``; None:
            all.
    """

    name: str
    mass: float
    at: Sequence[float] = (0.0, 0.0, 0.0)
    inertia: Any = None
    free: str | None = None

    def __post_init__(self) -> None:
        bounded(f"{self.name}: mass", self.mass, ge=0)
        bounded(f"{self.name}: at", self.at)
        if self.inertia is not None:
            bounded(f"{self.name}: inertia", self.inertia)

    @property
    def directions(self) -> list[int]:
        """Components it can move in: 0 to 2 along x, y, z, 3 to 5 about them."""
        if self.free is None:
            return list(range(3 if self.inertia is None else 6))
        words = self.free.split() if " " in self.free or "r" in self.free else list(self.free)
        unknown = [w for w in words if w not in DIRECTIONS]
        if unknown or not words:
            raise UserError(f"{self.name}: free: '{self.free}' is no list of directions; choose from x y z rx ry rz")
        found = sorted({DIRECTIONS.index(w) for w in words})
        if self.inertia is None and found[-1] > 2:
            raise UserError(f"{self.name}: free: a point mass does not turn; give it inertia or leave out rx, ry, rz")
        return found

    @property
    def mass_matrix(self) -> Array:
        """(6, 6) about the centre of mass."""
        J = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia, dtype=float)
        J = np.diag(J) if J.ndim == 1 else J
        return np.block([[self.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), J]])


@dataclass(frozen=True)
class Link:
    """A spring and a damper in parallel between two components, or a component and the ground.

    Attributes:
        first, second: names; ``ground`` is the ground. stiffness, damping: one number along `axis`, three along
            x, y, z, or six with those about x, y, z (N/m, N m/rad; N s/m, N m s/rad). axis: (3,) of one number; the
            line between the components' centres, else the one direction a component is free in, if it is None.
        at: (3,) where it acts on both, m; None: at each component's centre.
    """

    first: str
    second: str
    stiffness: Any = 0.0
    damping: Any = 0.0
    axis: Sequence[float] | None = None
    at: Sequence[float] | None = None


def Spring(
    first: str, second: str, stiffness: Any, axis: Sequence[float] | None = None, at: Sequence[float] | None = None
) -> Link:
    """A `Link` without damping."""
    return Link(first, second, stiffness=stiffness, axis=axis, at=at)


def Damper(
    first: str, second: str, damping: Any, axis: Sequence[float] | None = None, at: Sequence[float] | None = None
) -> Link:
    """A `Link` without stiffness."""
    return Link(first, second, damping=damping, axis=axis, at=at)


@dataclass(frozen=True)
class Contact:
    """A place of a component where it rubs: six rows in the frame n (out of the component), t1, t2; see `Interface`.

    Attributes:
        name. on: component. normal: (3,). t2: (3,) hint of the second tangent; an axis at right angles if None. at:
            (3,) m, the component's centre if None. width, height: extents b0, h0 of the patch, m. role, partner,
            sector_shift: see `Interface`.
    """

    name: str
    on: str
    normal: Sequence[float]
    t2: Sequence[float] | None = None
    at: Sequence[float] | None = None
    width: float = 0.0
    height: float = 0.0
    role: str = "ground"
    partner: str = ""
    sector_shift: int = 0

    @property
    def rotation(self) -> Array:
        """(3, 3), rows n, t1, t2."""
        n = _unit(self.normal, f"contact {self.name}: normal")
        hint = np.eye(3)[_across(n)] if self.t2 is None else _unit(self.t2, f"contact {self.name}: t2")
        t2 = hint - (hint @ n) * n
        if np.linalg.norm(t2) < 1e-6:
            raise UserError(f"contact {self.name}: t2 is parallel to the normal; choose another direction")
        t2 = t2 / np.linalg.norm(t2)
        return np.array([n, np.cross(t2, n), t2])


def _unit(direction: Sequence[float], what: str) -> Array:
    """(3,) a direction as a unit vector.

    Raises:
        UserError: it is none.
    """
    bounded(what, direction)
    try:
        v = np.array([not_too_large(float(x)) for x in has_length(tuple(direction))])
    except ValueError as error:
        raise UserError(f"{what}: {error}") from error
    return v / np.linalg.norm(v)


def _across(n: Array) -> int:
    """The last of the axes z, y, x that is nearest to a right angle with n."""
    return 2 - int(np.abs(n[::-1]).round(9).argmin())


@dataclass(frozen=True)
class Force:
    """A unit force (N) on a component along a direction. at: (3,) m; the component's centre if None."""

    name: str
    on: str
    direction: Sequence[float]
    at: Sequence[float] | None = None


@dataclass(frozen=True)
class Monitor:
    """The displacement along x, y, z that is read at a component. at: (3,) m; the component's centre if None."""

    name: str
    on: str
    at: Sequence[float] | None = None


@dataclass(frozen=True)
class System:
    """Members, what joins them, and what is asked of them.

    Attributes:
        name. components. links. contacts, forces, monitors: named rows. mass, stiffness, damping: (d, d) matrices over
            the free directions of the components in their order, added to what components and links give. ratio:
            damping ratio of every mode, added to the dampers'.
    """

    name: str
    components: Sequence[Body]
    links: Sequence[Link] = ()
    contacts: Sequence[Contact] = ()
    forces: Sequence[Force] = ()
    monitors: Sequence[Monitor] = ()
    mass: Any = None
    stiffness: Any = None
    damping: Any = None
    ratio: float = 0.0
    settings: Mapping[str, Any] = field(default_factory=dict)  # as written, for the modal file

    @staticmethod
    def of_matrices(name: str, M: Any, K: Any, C: Any = None, components: Sequence[Body] = (), **more: Any) -> System:
        """A system given by its matrices.

        Args:
            M, K, C: (d, d) mass, stiffness and damping. components: whose free directions, in their order, are the d
                coordinates (their own mass is added, so give it as 0); if none are given, the coordinates are the
                displacements along x of points ``1``, ``2``, ... one metre apart on the x axis.
            more: contacts, forces, monitors, ratio.
        """
        count = len(np.atleast_1d(M))
        points = components or [Body(str(i + 1), 0.0, (float(i), 0.0, 0.0), free="x") for i in range(count)]
        return System(name, points, mass=M, stiffness=K, damping=C, **more)

    @cached_property
    def _columns(self) -> dict[str, Array]:
        """Component -> (6, d) its motion per unit of each coordinate."""
        names = [m.name for m in self.components]
        twice = {n for n in names if names.count(n) > 1}
        if twice or GROUND in names:
            raise UserError(f"{self.name}: the name '{min(twice or {GROUND})}' is taken; give every component its own")
        places = [(m.name, d) for m in self.components for d in m.directions]
        found = {m.name: np.zeros((6, len(places))) for m in self.components}
        for column, (name, direction) in enumerate(places):
            found[name][direction, column] = 1.0
        return found

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return sum(len(m.directions) for m in self.components)

    def _component(self, name: str, what: str) -> Body:
        found = next((m for m in self.components if m.name == name), None)
        if found is None:
            known = ", ".join(m.name for m in self.components)
            raise UserError(f"{self.name}: {what}: there is no component '{name}'; choose one of {known}")
        return found

    def rows_at(self, name: str, at: Sequence[float] | None, what: str) -> tuple[Array, Array]:
        """(6, d) translations and rotations of the point `at` fixed to a component, and the point, m."""
        component = self._component(name, what)
        centre = np.asarray(component.at, dtype=float)
        point = centre if at is None else np.asarray(at, dtype=float)
        columns = self._columns[name]
        return np.vstack([columns[:3] - skew(point - centre) @ columns[3:], columns[3:]]), point

    def matrices(self) -> tuple[Array, Array, Array]:
        """(d, d) M, C, K.

        Raises:
            UserError: matrices of another size or not symmetric, a link to no component.
        """
        M = sum((self._columns[m.name].T @ m.mass_matrix @ self._columns[m.name] for m in self.components), np.zeros(1))
        parts = [self._linked(link) for link in self.links]
        K = sum((rows.T @ (k[:, None] * rows) for rows, k, _ in parts), np.zeros((self.count, self.count)))
        C = sum((rows.T @ (c[:, None] * rows) for rows, _, c in parts), np.zeros((self.count, self.count)))
        return M + self._given("mass"), C + self._given("damping"), K + self._given("stiffness")

    def _given(self, key: str) -> Array:
        value, d = getattr(self, key), self.count
        if value is None:
            return np.zeros((d, d))
        try:
            A = np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise UserError(f"{self.name}: {key}: must be {d} lists of {d} numbers each") from error
        if A.shape != (d, d):
            raise UserError(
                f"{self.name}: {key}: has the shape {' x '.join(map(str, A.shape))}, but the components are free to "
                f"move in {d} directions; give {d} lists of {d} numbers each"
            )
        if not np.isfinite(A).all():
            raise UserError(f"{self.name}: {key}: holds numbers that are not finite; correct them")
        if np.abs(A - A.T).max(initial=0.0) > 1e-9 * np.abs(A).max(initial=1e-300):
            i, j = np.unravel_index(np.abs(A - A.T).argmax(), A.shape)
            raise UserError(
                f"{self.name}: {key}: is not symmetric (entry {i + 1}, {j + 1} is {A[i, j]:g}, entry {j + 1}, {i + 1} "
                f"is {A[j, i]:g}); correct it"
            )
        return 0.5 * (A + A.T)

    def _linked(self, link: Link) -> tuple[Array, Array, Array]:
        """(r, d) relative motions of a link with their r stiffnesses and dampings."""
        what = f"link from {link.first} to {link.second}"
        ends = [self._end(n, link, what) for n in (link.first, link.second)]
        relative = ends[1][0] - ends[0][0]
        given = [np.atleast_1d(np.asarray(v, dtype=float)) for v in (link.stiffness, link.damping)]
        size = max(len(v) for v in given)
        k, c = (np.broadcast_to(v, size) if v.any() or len(v) == size else np.zeros(size) for v in given)
        if size not in (1, 3, 6) or (np.concatenate([k, c]) < 0).any() or not np.isfinite([k, c]).all():
            raise UserError(f"{self.name}: {what}: needs one, three or six numbers, finite and not negative")
        if size > 1:
            return relative[:size], k, c
        axis = self._axis(link, ends, what)
        return (axis @ relative[:3])[None], k, c

    def _end(self, name: str, link: Link, what: str) -> tuple[Array, Array | None]:
        if name == GROUND:
            return np.zeros((6, self.count)), None if link.at is None else np.asarray(link.at, dtype=float)
        return self.rows_at(name, link.at, what)

    def _axis(self, link: Link, ends: list[tuple[Array, Array | None]], what: str) -> Array:
        if link.axis is not None:
            return _unit(link.axis, f"{self.name}: {what}: axis")
        elif link.at is None and ends[0][1] is not None and ends[1][1] is not None:
            axis = ends[1][1] - ends[0][1]
        else:
            axis = np.zeros(3)
        if not np.linalg.norm(axis):
            moving = {d for n in (link.first, link.second) if n != GROUND for d in self._component(n, what).directions}
            if len(moving) != 1 or max(moving) > 2:
                raise UserError(f"{self.name}: {what}: along which direction does it act? Give its axis, [1, 0, 0] say")
            axis = np.eye(3)[min(moving)]
        return axis / np.linalg.norm(axis)

    def basis(self) -> ModalBasis:
        """All modes of the system, and its contacts, forces and monitors on them.

        Raises:
            UserError: a coordinate without mass, a stiffness that is not positive (semi)definite, a rigid motion that
                a damper brakes, a name used twice, a damping ratio of 1 or more, a direction that is none.
        """
        try:
            named_once(self, "contacts", "forces", "monitors")
            damping_ratio(self.ratio)
        except ValueError as error:
            raise UserError(f"{self.name}: {error}") from error
        M, C, K = self.matrices()
        values, X, rigid = _modes(self.name, M, K)
        faces = {c.name: self._face(c) for c in self.contacts}
        X = _canonical(X, values, rigid, [T for T, _ in faces.values()], self._shapes())
        omega = np.sqrt(np.where(np.arange(len(values)) < rigid, 0.0, values))
        C_r = X.T @ C @ X + np.diag(2 * self.ratio * omega)
        if np.abs(C_r[:rigid, :rigid]).max(initial=0.0) > 1e-9 * np.abs(C_r).max(initial=1e-300):
            raise UserError(f"{self.name}: a damper brakes a motion that no spring holds; add a spring beside it")
        D = np.divide(np.diag(C_r), 2 * omega, out=np.zeros_like(omega), where=omega > 0)
        group = self._group(X, omega, D, C_r, rigid, faces)
        size = np.abs(K).max() * np.abs(X).max(axis=0) + np.abs(M).max() * omega**2 * np.abs(X).max(axis=0)
        checks = {
            "orthogonality": float(np.abs(X.T @ M @ X - np.eye(len(omega))).max()),
            "backward_error": float((np.abs(K @ X - M @ X * omega**2).max(axis=0) / np.maximum(size, 1e-300)).max()),
            "certified": 1.0,  # a dense eigensolution has every mode
        }
        return self._body(replace(group, checks=checks), M, bool(rigid), "matrix" if C.any() else "ratio")

    def _shapes(self) -> Array:
        """(n, 3, d) displacements of the components' centres."""
        return np.array([self._columns[m.name][:3] for m in self.components])

    def _face(self, c: Contact) -> tuple[Array, Array]:
        rows, point = self.rows_at(c.on, c.at, f"contact {c.name}")
        R = c.rotation
        return np.vstack([R @ rows[:3], R @ rows[3:]]), point

    def _group(
        self, X: Array, omega: Array, D: Array, C_r: Array, rigid: int, faces: Mapping[str, tuple[Array, Array]]
    ) -> ModalGroup:
        loads, reads = {}, {}
        for f in self.forces:
            rows, point = self.rows_at(f.on, f.at, f"force {f.name}")
            along = _unit(f.direction, f"force {f.name}: direction") @ rows[:3]
            loads[f.name] = Rows(along[None] @ X, ("force",), "N", point, 0.0, np.zeros(1))
        for r in self.monitors:
            rows, point = self.rows_at(r.on, r.at, f"monitor {r.name}")
            reads[r.name] = Rows(rows[:3] @ X, ("u_x", "u_y", "u_z"), "m", point, 0.0, np.zeros(3))
        interfaces = {c.name: self._interface(c, *faces[c.name], X) for c in self.contacts}
        return ModalGroup(
            0.0, omega, ("rigid",) * rigid + ("normal",) * (len(omega) - rigid), D, np.eye(len(omega)),
            np.diag(omega**2), C_r, np.zeros_like(C_r), self._shapes() @ X, interfaces, loads, reads, {},
            _compliance(interfaces, loads, reads, omega), {}, np.zeros((len(self.components), 3)), {},
        )  # fmt: skip

    def _interface(self, c: Contact, T: Array, point: Array, X: Array) -> Interface:
        area = c.width * c.height or 1e-6  # m2; a point has none, a weight keeps means over the patch defined
        R, rows = c.rotation, T @ X
        return Interface(
            point, R, rows, np.zeros(X.shape[1]), point[None], np.array([area]), R[:1], (R.T @ rows[:3])[None],
            c.role, c.partner, c.sector_shift, np.array([c.width, c.height]),
        )  # fmt: skip

    def _body(self, group: ModalGroup, M: Array, free: bool, damping: str) -> ModalBasis:
        points = np.array([np.asarray(m.at, dtype=float) for m in self.components])
        mass, centre, inertia = self._inertia(points, M)
        sets = {m.name: np.array([i]) for i, m in enumerate(self.components)}
        mesh = Mesh(points, {}, {}, sets, np.arange(1, len(points) + 1))
        told = {"settings": json.dumps(self.settings, sort_keys=True, default=str)} if self.settings else {}
        return ModalBasis(
            self.name, mesh, {(0, 0): group}, mass, centre, inertia, np.array([0.0, 1.0, 0.0]), np.zeros(3), damping,
            free, "eigenmodes", told, source="matrices",
        )  # fmt: skip

    def _inertia(self, points: Array, M: Array) -> tuple[float, Array, Array]:
        """Mass, centre and inertia about it: of the rigid motions in the directions that are free."""
        R = np.zeros((self.count, 6))
        for m, x in zip(self.components, points, strict=True):
            R += self._columns[m.name].T @ np.block([[np.eye(3), -skew(x)], [np.zeros((3, 3)), np.eye(3)]])
        if self.mass is None:
            own = np.array([m.mass for m in self.components])
        else:  # row sums of what one direction carries
            carried = np.array([self._columns[m.name][:3] @ M @ R[:, :3] for m in self.components])
            own = np.array([np.diag(c).max() for c in carried])
        mass = float(own.sum())
        centre = own @ points / mass if mass else np.zeros(3)
        r = points - centre
        inertia = sum(m.mass_matrix[3:, 3:] for m in self.components) + np.einsum("n,nij->ij", own, _about(r))
        return mass, centre, inertia


def _about(r: Array) -> Array:
    """(n, 3, 3) inertia of unit masses at r."""
    return np.einsum("ni,ni->n", r, r)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", r, r)


def _modes(name: str, M: Array, K: Array) -> tuple[Array, Array, int]:
    """Eigenvalues (ascending), M-orthonormal shapes, and how many of them are rigid."""
    heaviest = np.abs(np.diag(M)).max(initial=0.0)
    if not len(M) or np.linalg.eigvalsh(M)[0] <= 1e-14 * heaviest:
        raise UserError(
            f"{name}: a coordinate has no mass (M is not positive definite); give every component some, or hold it"
        )
    values, X = scipy.linalg.eigh(K, M)
    top = max(float(np.abs(values).max()), 1e-300)
    if values[0] < -_RIGID * top * len(M):
        raise UserError(f"{name}: the stiffness is not positive (eigenvalue {values[0]:.4g} s^-2); correct its signs")
    return values, X, int((values < _RIGID * top * len(M)).sum())


def _canonical(X: Array, values: Array, rigid: int, faces: list[Array], shapes: Array) -> Array:
    """Definite signs and pairs, as for bodies of finite elements; the displacements decide where no contact moves."""
    lead = [*faces[:1], shapes.reshape(-1, X.shape[0]), np.eye(X.shape[0])]
    X = turn_clusters(X, values, np.vstack(lead), rigid)
    factor, size = np.zeros(X.shape[1]), np.abs(X).max(axis=0)
    for rows in lead:
        read = rows @ X
        moves = np.abs(read).max(axis=0, initial=0.0) > 1e-9 * size
        factor = np.where((factor == 0) & moves, signs(read) if len(read) else 1.0, factor)
    return X * factor


def _compliance(
    interfaces: Mapping[str, Interface], loads: Mapping[str, Rows], reads: Mapping[str, Rows], omega: Array
) -> Compliance:
    """Over every row; all modes are kept, so they hold all of it."""
    labels = [f"interface:{n}:{row}" for n, i in interfaces.items() if i.role != "load" for row in INTERFACE_ROWS]
    parts = [i.rows for i in interfaces.values() if i.role != "load"]
    for kind, named in (("excitation", loads), ("monitor", reads)):
        for n, rows in named.items():
            parts.append(rows.rows)
            labels += [f"{kind}:{n}:{label}" for label in rows.labels]
    T = np.concatenate(parts) if parts else np.zeros((0, len(omega)))
    elastic = omega > 0
    scaled = T[:, elastic] / omega[elastic]
    held = scaled @ scaled.T
    return Compliance(tuple(labels), held, held, bool((~elastic).any()), held)
