"""Patches that deform: points of two faces that move as the shapes of their bodies say, not as rigid ones.

The two meshes need not match. The points are those of the smaller face, the other one's shapes are interpolated to
them in the plane of the contact. What all shapes of both bodies do there, in every wave of a ring that is needed, is
spanned by few common coordinates: the six of the rigid patch, and deformations in the order of their compliance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.spatial import ConvexHull, Delaunay, cKDTree

from ..data import Array, Interface
from ..errors import UserError
from .assembly import ContactFace
from .component import Component, InWave
from .pairing import Pairing

NEIGHBOURS = 12
"""Points that an interpolation looks at: twice the six terms of a quadratic."""

COMPLIANT = 1e-4
"""Smallest displacement per root of energy that a deformation is kept for, over that of the most compliant one: what
is left out yields 1e-8 of it."""

ROUNDING = 1e-9
"""The same over that of the whole motion of the patch: below, it is rounding of a body that does not deform."""


@dataclass(frozen=True, eq=False)
class Nodal:
    """Points that two faces share and the coordinates that move them.

    Attributes:
        points: (n, 2) places along t1 and t2 from the first face's origin, m. areas: (n,) m2.
        shapes: (n, 3, k) of `contact.patch.Patch`, the first six rigid. first, second: index of a ring -> (k, m)
            motion along the coordinates, of `assembly.ContactFace`. lost: displacement that the coordinates do not
            follow, root mean square over that of the deformations at equal energy.
    """

    points: Array
    areas: Array
    shapes: Array
    first: Mapping[int, Array]
    second: Mapping[int, Array] | None
    lost: float

    @property
    def count(self) -> int:
        """k."""
        return self.shapes.shape[2]

    def sides(self, first: ContactFace, second: ContactFace | None) -> tuple[ContactFace, ContactFace | None]:
        """The two sides of a contact with the motion of the patch that deforms."""
        return replace(first, rows=self.first), None if second is None else replace(second, rows=self.second)


Face = tuple[Component, str]
"""A component and the name of one of its interfaces."""


def nodal(
    first: Face,
    second: Face | None = None,
    met: Pairing | None = None,
    indices: Sequence[int] = (0,),
    tolerance: float = COMPLIANT,
) -> Nodal:
    """Common coordinates of two faces that deform, or of one against a rigid wall.

    Args:
        met: how the two meet; needed with a second face. indices: of the ring's waves that the analysis needs, those
            of all harmonics (`assembly.Ring.index`). tolerance: see `COMPLIANT`.

    Raises:
        UserError: a modal file without patch shapes, coordinates that are forces, faces that do not overlap.
    """
    one = _interface(*first)
    take: tuple[Array | None, Array | None] = (None, None)
    if second is None or met is None:
        points, areas = (one.points - one.origin) @ one.rotation[1:].T, one.areas
    else:
        points, areas, take = _shared(one, _interface(*second), met)
    moved = [_motions(first, indices, np.eye(3), take[0])]
    if second is not None and met is not None:
        moved.append(_motions(second, indices, met.frame[:3, :3], take[1]))
    shapes, lost = _spanned(points, areas, moved, tolerance)
    rows = [{i: _coordinates(shapes, areas, S) for i, (S, _) in side.items()} for side in moved]
    return Nodal(points, areas, shapes, rows[0], rows[1] if len(rows) > 1 else None, lost)


def static_compliance(
    contact_sides: Sequence[tuple[Component, ContactFace, float]], index: int = 0, blades: int = 0
) -> Array:
    """(k, k) displacement along a contact's coordinates per unit of force on them, m/N, all else free.

    Of a body that nothing holds its elastic part, the rest of it being pushed by its own inertia.

    Args:
        contact_sides: component, side and sign (+1 first, -1 second). index, blades: of the wave, see `assembly.Ring`.
    """
    rows: dict[str, tuple[Component, Array]] = {}
    for component, side, sign in contact_sides:
        T = sign * side.motion(component.at(index), index, blades)
        rows[component.name] = (component, rows[component.name][1] + T if component.name in rows else T)
    return sum((_yield(component.at(index), T).real for component, T in rows.values()), np.zeros(()))


def _yield(wave: InWave, T: Array) -> Array:
    """(k, k) T K^-1 T^H, rigid motions left out."""
    group = wave.group
    if not (group.omega == 0).any():
        return T @ scipy.linalg.solve(wave.matrices[1], T.conj().T, assume_a="her")
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else wave._moving(group.to_diagonal)
    elastic = T @ V[:, group.omega > 0] / group.omega[group.omega > 0]
    return elastic @ elastic.conj().T


def _interface(component: Component, name: str) -> Interface:
    group = component.groups[min(component.groups)]
    if name not in group.interfaces:
        raise UserError(f"{component.name}: has no interface '{name}'; it has {', '.join(group.interfaces) or 'none'}")
    found = group.interfaces[name]
    if "interface-force" in group.kind:
        raise UserError(
            f"{component.name}:{name}: a node-wise patch needs displacements or modes as coordinates, but this modal "
            'file keeps forces; use "rubin" or "craig-bampton", or take a rigid patch'
        )
    return found


# points that both faces have -----------------------------------------------------------------------------------------


def _shared(one: Interface, two: Interface, met: Pairing) -> tuple[Array, Array, tuple[Array | None, Array | None]]:
    """Points and areas in the first face's frame, and the interpolation (n, p) from each face's own points to them."""
    a = (one.points - one.origin) @ one.rotation[1:].T
    Q = met.frame[:3, :3]
    b = met.offset + ((two.points - two.origin) @ two.rotation.T @ Q.T)[:, 1:]
    if one.areas.sum() <= two.areas.sum() * (1 + 1e-9):
        keep = _over(a, b)
        points, areas, maps = a[keep], one.areas[keep], (np.eye(len(a))[keep], interpolation(b, a[keep]))
    else:
        keep = _over(b, a)
        points, areas, maps = b[keep], two.areas[keep], (interpolation(a, b[keep]), np.eye(len(b))[keep])
    if len(points) < 3:
        raise UserError("node-wise patch: the faces have fewer than three points on each other; mesh the contact finer")
    return points, areas, maps


def _over(points: Array, other: Array) -> Array:
    """(n,) which points lie on the face whose points are `other`, its rim being half a point's distance further."""
    corners = other[ConvexHull(other).vertices]
    middle = corners.mean(axis=0)
    distance = np.sqrt(np.ptp(other, axis=0).prod() / len(other))
    size = np.linalg.norm(corners - middle, axis=1).max()
    rim = middle + (corners - middle) * (1 + distance / size)
    return Delaunay(rim).find_simplex(points) >= 0


def interpolation(known: Array, wanted: Array) -> Array:
    """(w, p) from values at scattered points (p, 2) to others (w, 2): moving least squares, exact for quadratics.

    It interpolates: a point that is known gets its own value.
    """
    out = np.zeros((len(wanted), len(known)))
    count = min(NEIGHBOURS, len(known))
    distance, nearest = cKDTree(known).query(wanted, k=count)
    for row, d, near in zip(range(len(wanted)), np.atleast_2d(distance), np.atleast_2d(nearest), strict=True):
        if d[0] <= 1e-9 * d[-1]:
            out[row, near[0]] = 1.0
            continue
        y, z = (known[near] - wanted[row]).T / d[-1]
        terms = np.column_stack([np.ones(count), y, z, y * y, y * z, z * z])
        weight = (1.05 - d / d[-1]) ** 2 / (d / d[-1])
        # value at the place itself: the constant term of the weighted fit
        out[row, near] = np.linalg.pinv(terms * weight[:, None], rcond=1e-8)[0] * weight
    return out


# coordinates ---------------------------------------------------------------------------------------------------------


def _motions(face: Face, indices: Sequence[int], Q: Array, take: Array | None) -> dict[int, tuple[Array, Array]]:
    """Index -> (n, 3, m) motion of the points in the first face's frame per unit coordinate, and (m, m) the factor
    that makes it one per root of energy."""
    component, name = face
    found = {}
    for index in sorted(set(indices)) if component.sectors > 1 else (0,):
        wave = component.at(index)
        item = wave.group.interfaces[name]
        if not len(item.shapes):
            raise UserError(
                f"{component.name}:{name}: a node-wise patch needs the shapes of the patch, which the modal file does "
                f"not hold at nodal diameter {wave.group.harmonic}; write it with output.patch_shapes = true and them "
                "in output.shape_nodal_diameters, or take a rigid patch"
            )
        S = np.einsum("ab,pbm->pam", Q @ item.rotation, wave._moving(item.shapes))
        found[index] = (S if take is None else np.tensordot(take, S, axes=1)), _per_energy(wave)
    return found


def _per_energy(wave: InWave) -> Array:
    """(m, m) coordinates of unit energy q^H (K + omega_1^2 M) q = 1, with the lowest elastic frequency omega_1, of a
    free body at speed (K at least -Omega^2 M) not below twice Omega."""
    M, K, _ = wave.matrices
    g = wave.group
    elastic, speed = g.omega[g.omega > 0], 2 * g.speed if (g.omega == 0).any() else 0.0
    values, V = scipy.linalg.eigh(K + (max(elastic.min(initial=np.inf), speed) ** 2 if len(elastic) else 1.0) * M)
    keep = values > 1e-14 * values.max()
    return V[:, keep] / np.sqrt(values[keep])


def _spanned(
    points: Array, areas: Array, moved: list[dict[int, tuple[Array, Array]]], tolerance: float
) -> tuple[Array, float]:
    """(n, 3, k) shapes: the rigid ones, then deformations orthogonal to them over the area; and what is lost."""
    from ..contact.patch import Patch

    rigid = Patch("", points, areas, None).kinematics  # type: ignore[arg-type]
    n, weight = len(points), np.repeat(np.sqrt(areas / areas.sum()), 3)[:, None]
    R = weight * rigid.reshape(3 * n, 6)
    basis, _ = np.linalg.qr(R)
    columns = [S.reshape(3 * n, -1) @ L for side in moved for S, L in side.values()]
    U = weight * np.column_stack([part for c in columns for part in ((c.real, c.imag) if np.iscomplexobj(c) else (c,))])
    left = U - basis @ (basis.T @ U)
    left -= basis @ (basis.T @ left)
    vectors, size, _ = np.linalg.svd(left, full_matrices=False)
    whole = np.linalg.norm(U, ord=2) if U.size else 0.0
    kept = size > max(tolerance * size.max(initial=0.0), ROUNDING * whole)
    deformations = (vectors[:, kept] / weight).reshape(n, 3, -1)
    total = np.sqrt((size[size > ROUNDING * whole] ** 2).sum())
    dropped = np.sqrt((size[~kept & (size > ROUNDING * whole)] ** 2).sum())
    return np.concatenate([rigid, deformations], axis=2), float(dropped / total) if total else 0.0


def _coordinates(shapes: Array, areas: Array, S: Array) -> Array:
    """(k, m) coordinates that move the points most nearly as S (n, 3, m), by area."""
    weight = np.repeat(areas, 3)[:, None]
    A = shapes.reshape(len(weight), -1)
    return np.linalg.solve(A.T @ (weight * A), A.T @ (weight * S.reshape(len(weight), -1)))
