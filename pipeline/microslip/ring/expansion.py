"""The whole ring from one sector: shapes of every sector, engine orders and nodal diameters, the ring's certificate.

Conventions (docs/cyclic.md): sector j + 1 stands at +2 pi / N about the rotation axis from sector j. At the nodal
diameter k, 0 <= k <= N/2, sector j moves as R^j phi exp(+i j k 2 pi / N), R the turn by 2 pi / N (Thomas,
Int. J. Num. Meth. Eng. 14 (1979) 81). With the time factor exp(+i Omega t) such a wave runs against the numbers of
the sectors: backward on a rotor that turns in the + direction. Its complex conjugate runs forward.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..basis import Check
from ..basis.integrals import modal_mass
from ..data import Array, Indices, Mesh, ModalBasis, ModalGroup
from ..errors import UserError
from ..frames import rotation
from ..reduced.coordinates import in_modes, own_kind

BACKWARD, FORWARD, STANDING = "backward", "forward", "standing"

PHASE_RULE = 1e-8
"""Largest violation of the phase rule on the cyclic faces, over the largest displacement, that `ring_checks` passes:
the tie is imposed exactly, what is left is the rounding of one multiplication."""


# --- engine orders and nodal diameters -----------------------------------------------------------------------------


def aliased(engine_order: int, sectors: int, harmonic: int = 1) -> tuple[int, str]:
    """The nodal diameter that an engine order excites, and which way the wave runs on the rotor.

    A pattern cos(e theta) that stands in space acts on sector j of a rotor that turns at Omega with the phase
    e (j 2 pi / N + Omega t); N sectors cannot tell e from e mod N, nor more than N/2 waves from a wave that runs the
    other way.

    Args:
        engine_order: e >= 0. sectors: N. harmonic: h, for the h-th harmonic h e of a force that is not a sine.

    Returns:
        k = e mod N, ``backward`` if that is below N/2; k = N - e mod N, ``forward`` if it is above; ``standing`` for
        k = 0 and k = N/2, where both directions are the same motion.
    """
    left = (engine_order * harmonic) % sectors
    if left == 0 or 2 * left == sectors:
        return left, STANDING
    return (left, BACKWARD) if 2 * left < sectors else (sectors - left, FORWARD)


def exciting(nodal_diameter: int, sectors: int, highest: int) -> list[tuple[int, str]]:
    """All engine orders from 1 to `highest` that excite a nodal diameter, with the direction of the wave."""
    found = [(e, *aliased(e, sectors)) for e in range(1, highest + 1)]
    return [(e, direction) for e, k, direction in found if k == nodal_diameter]


def multiplicity(nodal_diameter: int, sectors: int) -> int:
    """Ring modes per sector mode: 1 for k = 0 and N/2, else 2 (a pair that runs forward and backward)."""
    return 1 if nodal_diameter == 0 or 2 * nodal_diameter == sectors else 2


# --- expansion -----------------------------------------------------------------------------------------------------


def sector_rotation(basis: ModalBasis, sector: int) -> Array:
    """(3, 3) R^j: from sector 0, the one in the file, to sector j."""
    return rotation(basis.rotation_axis, 2 * np.pi * (sector % basis.sectors) / basis.sectors)


def phase(group: ModalGroup, sectors: int, sector: int) -> complex | float:
    """exp(i j k 2 pi / N); +1 or -1 at the nodal diameters 0 and N/2."""
    k = group.harmonic
    if multiplicity(k, sectors) == 1:
        return -1.0 if k and sector % 2 else 1.0
    return complex(np.exp(2j * np.pi * ((k * sector) % sectors) / sectors))


def expand(group: ModalGroup, basis: ModalBasis, sector: int) -> Array:
    """(n, 3, m) displacement of sector j, R^j phi exp(i j k 2 pi / N), in the order of the sector's points.

    Raises:
        UserError: the file holds no shapes.
    """
    if not len(group.phi):
        raise UserError(f"{basis.name}: the modal file holds no shapes (output.shapes = false); write it with them")
    turned = np.tensordot(sector_rotation(basis, sector), group.phi, axes=(1, 1)).transpose(1, 0, 2)
    return turned * phase(group, basis.sectors, sector)


def ring_scale(group: ModalGroup, sectors: int) -> float:
    """Factor on the sector's shapes that normalises the real ring modes on the ring: sqrt(2/N), or sqrt(1/N)."""
    return float(np.sqrt(multiplicity(group.harmonic, sectors) / sectors))


def standing(group: ModalGroup, basis: ModalBasis, sector: int) -> tuple[Array, ...]:
    """The real ring modes on sector j, mass-normalised on the ring: a pair for 0 < k < N/2, else one.

    Returns:
        (n, 3, m) arrays: real and imaginary part of the wave times sqrt(2/N), or the shapes times sqrt(1/N).
    """
    wave = ring_scale(group, basis.sectors) * expand(group, basis, sector)
    return (wave.real, wave.imag) if multiplicity(group.harmonic, basis.sectors) == 2 else (wave.real,)


@dataclass(frozen=True)
class Ring:
    """The mesh of the whole ring.

    Attributes:
        mesh: points and cells of sector 0, then sector 1, ...; faces ``<name>_<sector>``.
        numbers: (N, n) ring point of each point of each sector.
    """

    mesh: Mesh
    numbers: Indices

    def gather(self, per_sector: Array) -> Array:
        """(ring points, ...) values from (N, n, ...) ones; where sectors share a point the last one counts."""
        out = np.zeros((self.mesh.n_points, *per_sector.shape[2:]), dtype=per_sector.dtype)
        out[self.numbers] = per_sector
        return out


def replicate(
    mesh: Mesh, axis: Array, point: Array, sectors: int, faces: tuple[str, str] | None = None, named: bool = False
) -> Ring:
    """The mesh of all sectors.

    Args:
        mesh: of one sector. axis, point: of the rotation. faces: left and right cyclic face, whose points are then
            shared by neighbours; None leaves every sector its own points. named: keep the faces, one of each per
            sector, as ``<name>_<sector>`` (shared cyclic faces, which lie inside the ring, are left out).

    Raises:
        UserError: `faces` whose points do not match under the sector's turn.
    """
    n = mesh.n_points
    turned = [(mesh.points - point) @ rotation(axis, 2 * np.pi * s / sectors).T + point for s in range(sectors)]
    numbers = np.arange(sectors * n).reshape(sectors, n)
    if faces is not None:
        left, right = tied_points(mesh, axis, point, sectors, faces)
        numbers[:, right] = np.roll(numbers[:, left], -1, axis=0)
        centre = left[left == right]  # points on the axis belong to every sector
        numbers[:, centre] = centre
    used, flat = np.unique(numbers, return_inverse=True)
    numbers = flat.reshape(sectors, n)
    cells = {t: np.concatenate([numbers[s][c] for s in range(sectors)]) for t, c in mesh.cells.items()}
    kept = [f for f in mesh.faces if faces is None or f not in faces] if named else []
    every = {
        f"{f}_{s}": {t: numbers[s][facets] for t, facets in mesh.faces[f].items()} for f in kept for s in range(sectors)
    }
    return Ring(Mesh(np.concatenate(turned)[used], cells, every, node_id=np.arange(1, len(used) + 1)), numbers)


def ring_of(basis: ModalBasis, shared: bool = False, named: bool = False) -> Ring:
    """The ring of a modal file; see `replicate` (shared: neighbours share the points of the cyclic faces)."""
    faces = basis.cyclic_faces if shared else None
    return replicate(basis.mesh, basis.rotation_axis, basis.rotation_point, basis.sectors, faces, named)


def tied_points(mesh: Mesh, axis: Array, point: Array, sectors: int, faces: tuple[str, str]) -> tuple[Indices, Indices]:
    """Points of the left cyclic face, and those of the right one onto which the sector's turn carries them.

    Raises:
        UserError: a face is missing, or the points do not match to 1e-6 of the body's size.
    """
    from scipy.spatial import KDTree

    missing = [f for f in faces if f not in mesh.faces and f not in mesh.point_sets]
    if missing:
        raise UserError(f"cyclic: the mesh has no face '{missing[0]}'; name the two cyclic faces")
    left, right = (mesh.face_points(f) for f in faces)
    turned = (mesh.points[left] - point) @ rotation(axis, 2 * np.pi / sectors).T + point
    size = float(np.ptp(mesh.points, axis=0).max())
    distance, nearest = (np.asarray(a) for a in KDTree(mesh.points[right]).query(turned))
    if len(left) != len(right) or distance.max() > 1e-6 * size or len(np.unique(nearest)) < len(left):
        raise UserError(
            f"cyclic: face '{faces[0]}' turned by 2 pi / {sectors} does not meet '{faces[1]}' point by point "
            f"({len(left)} and {len(right)} points, {distance.max():.3g} m apart at most)"
        )
    return left, right[nearest]


# --- certificate ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RingCertificate:
    """What one sector proves about the modes of the ring at one speed.

    Attributes:
        limit: Hz; all ring modes up to here are known (0: nothing is proved).
        count: how many they are. counts: nodal diameter -> its share, pairs counted twice.
        missing: nodal diameters from 0 to N/2 that the file does not hold; the proof leaves them out.
        orthogonality: largest entry of Psi^H M Psi - 1 over all ring modes Psi.
        phase_rule: largest difference between the right cyclic face and the turned and shifted left one, over the
            largest displacement; nan if the faces are not named in the file.
        certified: True if the count of every nodal diameter is certified and none is missing.
    """

    limit: float
    count: int
    counts: Mapping[int, int]
    missing: tuple[int, ...]
    orthogonality: float
    phase_rule: float
    certified: bool


def certify_ring(basis: ModalBasis, speed: int = 0) -> RingCertificate:
    """Certify all ring modes at one speed (an index) from the one sector, without any matrix of the ring.

    Ring modes of different nodal diameters are orthogonal because (1/N) sum_j exp(i j (l - k) 2 pi / N) = 0, times a
    product of the sector that is at most 1; those of one nodal diameter because the sector's are. And because the
    phase rules split the ring's problem into one of the sector for each k, the ring has as many modes below a bound
    as the sector's problems together, those of 0 < k < N/2 twice.
    """
    N = basis.sectors
    groups = {k: g for (s, k), g in sorted(basis.groups.items()) if s == speed}
    missing = tuple(k for k in range(N // 2 + 1) if k not in groups)
    limits = {k: _proved(g) for k, g in groups.items()}
    limit = min(limits.values(), default=0.0)
    slack = 1 + 1e-12  # the highest mode itself counts
    counts = {k: multiplicity(k, N) * int((g.frequency <= limit * slack).sum()) for k, g in groups.items()}
    shown = [g for g in groups.values() if len(g.phi)]
    own = max((_own_orthogonality(basis, in_modes(g)) for g in shown), default=np.nan)
    orthogonality = max(own, _cross(tuple(groups), N))
    counts = counts if limit else {}
    return RingCertificate(
        limit, sum(counts.values()), counts, missing, orthogonality, _phase_rule(basis, shown),
        bool(limit > 0 and not missing),
    )  # fmt: skip


def _proved(g: ModalGroup) -> float:
    """Hz up to which a group holds every mode of its nodal diameter, by its inertia count."""
    if not g.checks.get("certified") or not len(g.omega):
        return 0.0
    limit = float(g.checks.get("upper_shift_hz", 0.0))
    modes = np.array([kind != "attachment" for kind in own_kind(g)])
    if int((g.frequency[modes] <= limit).sum()) >= g.checks.get("count_below_upper_shift", np.inf):
        return limit
    return float(g.frequency[-1]) if g.to_diagonal is None else 0.0  # eigenmodes cut at a frequency


def _own_orthogonality(basis: ModalBasis, g: ModalGroup) -> float:
    inner, volume = modal_mass(basis.mesh, g.phi)
    return float(np.abs(inner * basis.mass / volume - np.eye(g.n_modes)).max())


def _cross(harmonics: tuple[int, ...], N: int) -> float:
    """Largest product of unit ring modes of two different nodal diameters, both members of each pair."""
    waves = sorted({k for h in harmonics for k in (h, (-h) % N)})
    E = np.exp(2j * np.pi * np.outer(waves, np.arange(N)) / N)
    return float(np.abs(E.conj() @ E.T / N - np.eye(len(waves))).max(initial=0.0))


def _phase_rule(basis: ModalBasis, groups: list[ModalGroup]) -> float:
    try:
        left, right = tied_points(
            basis.mesh, basis.rotation_axis, basis.rotation_point, basis.sectors, basis.cyclic_faces
        )
    except UserError:
        return float("nan")
    R, worst = sector_rotation(basis, 1), 0.0
    for g in groups:
        wanted = np.tensordot(g.phi[left], R, axes=(1, 1)).transpose(0, 2, 1) * phase(g, basis.sectors, 1)
        worst = max(worst, float(np.abs(g.phi[right] - wanted).max() / max(np.abs(g.phi).max(), 1e-300)))
    return worst if groups else float("nan")


def ring_checks(basis: ModalBasis) -> list[Check]:
    """What `certify_ring` finds at every speed, as findings beside those of `check_basis`; none without a ring."""
    out: list[Check] = []
    for speed in sorted({s for s, _ in basis.groups}) if basis.sectors > 1 else []:
        found, where = certify_ring(basis, speed), f"speed_{speed}: ring of {basis.sectors}"
        if np.isfinite(found.orthogonality):
            value = found.orthogonality
            out.append(Check(f"{where}: modes are mass-orthonormal", value, 1e-8, value <= 1e-8))
        if np.isfinite(found.phase_rule):
            value = found.phase_rule
            out.append(Check(f"{where}: the cyclic faces obey the phase rule", value, PHASE_RULE, value <= PHASE_RULE))
        out.append(Check(f"{where}: certified up to Hz", found.limit, np.inf, True, certificate_words(found)))
    return out


def certificate_words(found: RingCertificate) -> str:
    """The certificate in one sentence."""
    if not found.limit:
        return "nothing proves how many modes the ring has"
    if found.missing:
        lacking = ", ".join(map(str, found.missing))
        return f"{found.count} ring modes up to {found.limit:.6g} Hz, without the nodal diameters {lacking}"
    return f"all {found.count} modes of the ring up to {found.limit:.6g} Hz"
