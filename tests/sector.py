"""A twisted annular sector of bricks and its cyclic modal basis, solved densely within a second, for tests of the ring.

The phase rule is imposed by an explicit transformation u = T_k v (left face and inside are v, the right face is the
left one turned and shifted in phase), so that nothing here depends on the package's own cyclic solver.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.linalg
from meshes import brick

from microslip.data import Array, Compliance, Mesh, ModalBasis, ModalGroup
from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.frames import skew
from microslip.linalg.canonical import by_place, signs
from microslip.modal.body_rows import BodyRows, body_rows, reduced_interfaces, reduced_rows
from microslip.settings.body import BodySettings

BORE, RIM, WIDTH = 0.05, 0.12, 0.012  # m
YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0
NAMES = {"x0": "bore", "x1": "rim", "y0": "cyclic_left", "y1": "cyclic_right", "z0": "front", "z1": "rear"}


def mesh(sectors: int = 6, divisions: tuple[int, int, int] = (3, 2, 1), cell: str = "hexahedron20") -> Mesh:
    """A sector about the y-axis with swept, wavy sides: no mirror symmetry is left, the cyclic one is exact."""
    angle = 2 * np.pi / sectors

    def bend(p: Array) -> Array:
        r, turn = p[:, 0], p[:, 1]
        turn = turn + 3.0 * (r - BORE)
        y = p[:, 2] * (1 + 0.4 * np.sin(sectors * p[:, 1])) + 0.2 * (r - BORE)
        return np.column_stack([r * np.sin(turn), y, r * np.cos(turn)])

    raw = brick(cell, divisions, (RIM - BORE, angle, WIDTH), (BORE, -angle / 2, 0), bend)
    return Mesh(raw.points, raw.cells, {NAMES[f]: blocks for f, blocks in raw.faces.items()}, {}, raw.node_id)


def settings(sectors: int) -> BodySettings:
    """Of the sector, with an interface, an excitation and a monitor at the rim."""
    y = 0.2 * (RIM - BORE)
    angle = 3.0 * (RIM - BORE)
    tip = [RIM * np.sin(angle), y, RIM * np.cos(angle)]
    return BodySettings.model_validate(
        {
            "name": "sector",
            "length_unit": "m",
            "geometry": {"mesh": "sector.msh"},
            "material": {"density": DENSITY, "young": YOUNG, "poisson": POISSON},
            "supports": [{"face": "bore"}],
            "cyclic": {"sectors": sectors},
            "interfaces": [{"name": "rim", "face": "rim", "t2": [0.0, 1.0, 0.0]}],
            "excitations": [{"name": "gas", "point": tip, "direction": [0.0, 1.0, 0.0]}],
            "monitors": [{"name": "tip", "point": tip}],
            "rotation": {"axis": [0.0, 1.0, 0.0], "speeds_rpm": [0.0]},
        }
    )


def matrices(body: Mesh) -> tuple[Array, Array]:
    """Dense K and M (3n, 3n) without supports."""
    d = discretise(body)
    K = d.pattern.full(stiffness(d, isotropic(YOUNG, POISSON)))
    M = d.pattern.full(mass(d, DENSITY)[:, None, None] * np.eye(3))
    return K.toarray(), M.toarray()


def turn_y(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def partners(body: Mesh, sectors: int) -> list[tuple[int, int]]:
    """(left, right) points that the sector's turn carries onto each other, by comparing all with all."""
    left, right = body.face_points("cyclic_left"), body.face_points("cyclic_right")
    moved = body.points[left] @ turn_y(2 * np.pi / sectors).T
    gap = np.linalg.norm(moved[:, None] - body.points[right][None], axis=2)
    assert gap.min(axis=1).max() < 1e-12
    return list(zip(left.tolist(), right[gap.argmin(axis=1)].tolist(), strict=True))


def tie(body: Mesh, sectors: int, k: int) -> Array:
    """(3n, v) T_k, without the points of the bore."""
    n, angle = body.n_points, 2 * np.pi / sectors
    right = {r: a for a, r in partners(body, sectors)}
    held = set(body.face_points("bore").tolist())
    own = [p for p in range(n) if p not in right and p not in held]
    column = {p: i for i, p in enumerate(own)}
    T = np.zeros((n, 3, len(own), 3), dtype=complex)
    for p, i in column.items():
        T[p, :, i] = np.eye(3)
    for r, a in right.items():
        if a in column:
            T[r, :, column[a]] = turn_y(angle) * np.exp(1j * k * angle)
    T = T.reshape(3 * n, -1)
    return T.real if k == 0 or 2 * k == sectors else T


@cache
def basis(
    sectors: int = 6, count: int = 5, rpm: tuple[float, ...] = (0.0,), harmonics: tuple[int, ...] | None = None
) -> ModalBasis:
    """The cyclic basis; treat it as read-only. A speed makes everything stiffer by 1 + (rpm / 100000)^2."""
    body, chosen = mesh(sectors), settings(sectors)
    K, M = matrices(body)
    rows = body_rows(body, chosen)
    groups = {
        (s, k): _group(body, chosen, rows, K * (1 + (speed / 1e5) ** 2), M, k, count, speed * np.pi / 30)
        for s, speed in enumerate(rpm)
        for k in (range(sectors // 2 + 1) if harmonics is None else harmonics)
    }
    ones = np.tile(np.eye(3), (body.n_points, 1))
    total = (ones.T @ M @ ones)[0, 0]
    centre = (ones.T @ M @ body.points.reshape(-1))[:3] / total
    spin = np.array([np.cross(e, body.points - centre).reshape(-1) for e in np.eye(3)])
    return ModalBasis(
        "sector", body, groups, float(total), centre, spin @ M @ spin.T, np.array([0.0, 1.0, 0.0]), np.zeros(3),
        "ratio", False, "eigenmodes", {"settings": '{"rotation": {"engine_orders": [1, 2, 5, 6]}}'}, sectors,
    )  # fmt: skip


def _group(
    body: Mesh, chosen: BodySettings, rows: BodyRows, K: Array, M: Array, k: int, count: int, speed: float
) -> ModalGroup:
    T = tie(body, chosen.cyclic.sectors, k)
    H = T.conj().T
    values, vectors = scipy.linalg.eigh(H @ K @ T, H @ M @ T)
    omega, phi = np.sqrt(values[:count]), T @ vectors[:, :count]
    phi = phi * signs(phi[by_place(body.points)])
    shapes, m = phi.reshape(body.n_points, 3, count), count
    B, labels = rows.stacked
    modal = (B @ phi / values[:count]) @ (B @ phi).conj().T
    static = B @ T @ np.linalg.solve(H @ K @ T, H @ B.T.toarray())
    G = 2 * speed * phi.conj().T @ np.kron(np.eye(body.n_points), skew(np.array([0.0, 1.0, 0.0]))) @ (M @ phi)
    upper = float(np.sqrt(0.5 * (values[count - 1] + values[count])) / 2 / np.pi)
    own = np.abs(phi.conj().T @ M @ phi - np.eye(m)).max()
    return ModalGroup(
        speed=speed, omega=omega, kind=("normal",) * m, damping_ratio=np.full(m, 0.001), M_r=np.eye(m),
        K_r=np.diag(omega**2), C_r=np.diag(0.002 * omega), G_r=0.5 * (G - G.conj().T), phi=shapes,
        interfaces=reduced_interfaces(rows, phi, shapes),
        excitations={name: reduced_rows(v, phi, None) for name, v in rows.excitations.items()},
        monitors={name: reduced_rows(v, phi, np.zeros(3 * body.n_points)) for name, v in rows.monitors.items()},
        gauges={}, compliance=Compliance(labels, 0.5 * (static + static.conj().T), modal, False), stresses={},
        u_static=np.zeros((body.n_points, 3)),
        checks={
            "certified": 1.0, "count_below_upper_shift": float(m), "upper_shift_hz": upper,
            "orthogonality": float(own), "backward_error": 1e-16,
        },
        harmonic=k,
    )  # fmt: skip
