"""The body at any speed of a range, from the samples of its modal file: `group_at`, `basis_at`. Pure numpy and scipy.

How the samples are made and interpolated is told in `modal.range_basis`; the reduction that the body file asks for is
carried out anew at the speed, within the common coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import (
    Array,
    Compliance,
    ContactState,
    GyroscopicModes,
    ModalBasis,
    ModalGroup,
    Rows,
    RunUp,
    SpeedRange,
    StressSet,
)
from ..errors import UserError
from ..linalg import canonical, eigen
from ..linalg.gyroscopic import gyroscopic_modes, hermitian_modes
from ..reduced.coordinates import compliance_rows, in_coordinates
from ..reduction import METHODS, Reduced, Substructure
from ..units import from_rpm, rpm_text, to_rpm
from .group import modal_damping, without_massless
from .range_basis import interpolant, lagrange
from .solution import held_compliance


def group_at(basis: ModalBasis, rpm: float, harmonic: int = 0) -> ModalGroup:
    """The reduced body at a speed of its range, as if it had been solved for there.

    Args:
        rpm: rotation speed. harmonic: nodal diameter.

    Raises:
        UserError: no range in the file, a speed outside of it.
    """
    r, speed = _range_of(basis, harmonic), from_rpm(rpm)
    low, high = r.speeds[[0, -1]]
    if not low * (1 - 1e-9) <= speed <= high * (1 + 1e-9):
        raise UserError(
            f"{rpm:.10g} rpm is outside the speed range of '{basis.name}', {to_rpm(low):.6g} to "
            f"{rpm_text(high)}; ask for a speed inside, or widen rotation.range_rpm and make the modes anew"
        )
    at = _Evaluated(basis, r, float(np.clip(speed, low, high)))
    return at.group()


def basis_at(basis: ModalBasis, rpm: float) -> ModalBasis:
    """A modal basis with this one speed: a speed of the file as it stands, or one of its range.

    Raises:
        UserError: see `group_at`.
    """
    stations = sorted({s for s, _ in basis.groups if abs(_rpm_of(basis, s) - rpm) <= 1e-9 * max(abs(rpm), 1.0)})
    if stations:
        groups = {(0, k): g for (s, k), g in basis.groups.items() if s == stations[0]}
        return replace(basis, groups=groups, ranges={})
    harmonics = sorted(basis.ranges) or [0]
    return replace(basis, groups={(0, k): group_at(basis, rpm, k) for k in harmonics}, ranges={})


def _rpm_of(basis: ModalBasis, speed: int) -> float:
    return to_rpm(next(g.speed for (s, _), g in sorted(basis.groups.items()) if s == speed))


def _range_of(basis: ModalBasis, harmonic: int) -> SpeedRange:
    if harmonic in basis.ranges:
        return basis.ranges[harmonic]
    if basis.ranges:
        known = ", ".join(str(k) for k in sorted(basis.ranges))
        raise UserError(f"nodal diameter {harmonic}: '{basis.name}' has speed ranges of {known} only; choose one")
    stations = [_rpm_of(basis, s) for s in sorted({s for s, _ in basis.groups})]
    raise UserError(
        f"the modal file of '{basis.name}' has no speed range; write rotation.range_rpm = [low, high] and make the "
        f"modes anew, or choose one of its speeds, {', '.join(f'{rpm:.6g}' for rpm in stations)} rpm"
    )


def frequencies_over(r: SpeedRange, speeds: Array, count: int | None = None) -> tuple[Array, list[Array]]:
    """Frequencies (p, m) in rad/s, and modes (c, m) in the common coordinates, at speeds (p,) of a range.

    Much cheaper than `group_at`: nothing of the mesh's size is touched. The modes are orthonormal.
    """
    return _over(speeds, interpolant(r).modes, count or r.count)


def waves_over(r: SpeedRange, speeds: Array, forward: bool) -> tuple[Array, list[Array]]:
    """`frequencies_over` with gyroscopic coupling, for the waves that run forward or the others.

    Raises:
        numpy.linalg.LinAlgError: the body is unstable at one of the speeds.
    """
    run_up, parts = r.samples[0].run_up, interpolant(r)
    if run_up is None:
        return frequencies_over(r, speeds)

    def waves(speed: float) -> tuple[Array, Array]:
        N = run_up.N
        values, x = hermitian_modes(np.eye(len(N)), 2 * speed * N, parts.stiffness(speed))
        chosen = np.flatnonzero(values < 0 if forward else values > 0)
        chosen = chosen[np.argsort(np.abs(values[chosen]), kind="stable")][: r.count]
        return np.abs(values[chosen]), x[:, chosen] / np.linalg.norm(x[:, chosen], axis=0)

    return _over(speeds, waves, r.count)


def _over(
    speeds: Array, modes_at: Callable[[float], tuple[Array, Array]], count: int
) -> tuple[Array, list[Array]]:
    every = [modes_at(float(speed)) for speed in speeds]
    omega = np.reshape([values[:count] for values, _ in every], (len(every), count))
    return omega, [modes[:, :count] for _, modes in every]


class _Evaluated:
    """A range at one speed."""

    def __init__(self, basis: ModalBasis, r: SpeedRange, speed: float) -> None:
        self.basis, self.range, self.speed = basis, r, speed
        self.weights = lagrange(r.speeds, speed, r.shift)
        found = interpolant(r)
        self.K, self.modes = found.stiffness(speed), found.modes(speed)
        self.T = compliance_rows(r.samples[0])
        self.contacts = contacts_between(r, speed)

    def between(self, values: Iterable[Array]) -> Array:
        """An array of every sample, interpolated entry by entry."""
        return np.sum([w * v for w, v in zip(self.weights, values, strict=True)], axis=0)

    def group(self) -> ModalGroup:
        reduced = self._reduced()
        ratios, labels = self._damping(reduced), self.range.samples[0].compliance.labels
        common = self._common()
        g = in_coordinates(common, reduced.vectors)
        plain = METHODS["eigenmodes"](self.problem)
        compliance = replace(
            common.compliance,
            modal=held_compliance(self.T @ reduced.vectors, reduced, labels),
            eigenmodes=held_compliance(self.T @ plain.vectors, plain, labels),
        )
        run_up = without_massless(g.run_up, reduced) if g.run_up else None
        return replace(
            g,
            omega=reduced.omega,
            kind=reduced.kind,
            damping_ratio=ratios,
            M_r=reduced.M_r,
            K_r=reduced.K_r,
            C_r=modal_damping(reduced, 2 * ratios * reduced.omega),
            G_r=2 * self.speed * run_up.N if run_up else g.G_r,
            run_up=run_up,
            gyroscopic=self._gyroscopic(reduced, run_up),
            to_diagonal=reduced.to_diagonal,
            compliance=compliance,
            checks={"held_out_error": float(self.range.total_error.max()), **self._contact_checks()},
        )

    def _contact_checks(self) -> dict[str, float]:
        error = normal_force_error(self.range, self.speed)
        return {"normal_force_error": error} if self.contacts and np.isfinite(error) else {}

    def _gyroscopic(self, reduced: Reduced, run_up: RunUp | None) -> GyroscopicModes | None:
        if run_up is None or not (self.speed and self.range.gyroscopic):
            return None
        V = np.eye(len(reduced.omega)) if reduced.to_diagonal is None else reduced.to_diagonal
        N = V.conj().T @ run_up.N @ V
        own = gyroscopic_modes(np.eye(len(N)), 2 * self.speed * N, np.diag(reduced.omega**2), N)
        return replace(own, shapes=V @ own.shapes)

    def _common(self) -> ModalGroup:
        """The body at the speed in the common coordinates, but for its stiffness and frequencies."""
        last, r = self.range.samples[-1], self.range
        return replace(
            last,
            speed=self.speed,
            K_r=self.K,
            G_r=last.G_r * (self.speed / last.speed),
            monitors={k: self._rows([g.monitors[k] for g in r.samples]) for k in last.monitors},
            gauges={k: self._rows([g.gauges[k] for g in r.samples]) for k in last.gauges},
            stresses={k: self._stress([g.stresses[k] for g in r.samples]) for k in last.stresses},
            u_static=self.between(g.u_static for g in r.samples),
            compliance=self._compliance(),
            run_up=self._run_up(),
            contacts=self.contacts,
            invariants=None,  # they follow the displaced body and are asked for at speeds of their own
            prestress=last.prestress if self.speed else r.samples[0].prestress,
        )

    def _run_up(self) -> RunUp | None:
        """N and P are the same at all speeds; the loads follow the displaced body."""
        first = self.range.samples[0].run_up
        if first is None:
            return None
        all_of = [g.run_up for g in self.range.samples if g.run_up is not None]
        return replace(
            first, euler=self.between(r.euler for r in all_of), centrifugal=self.between(r.centrifugal for r in all_of)
        )

    def _rows(self, rows: list[Rows]) -> Rows:
        return replace(rows[-1], rows=self.between(r.rows for r in rows), static=self.between(r.static for r in rows))

    def _stress(self, sets: list[StressSet]) -> StressSet:
        return replace(
            sets[-1],
            strain=self.between(s.strain for s in sets),
            stress=self.between(s.stress for s in sets),
            static_stress=self.between(s.static_stress for s in sets),
        )

    def _compliance(self) -> Compliance:
        """What the common coordinates hold at the speed, and the little that they leave out, interpolated."""
        T = self.T

        def left(g: ModalGroup) -> Array:
            return g.compliance.static - T @ np.linalg.solve(g.K_r, T.conj().T)

        static = T @ np.linalg.solve(self.K, T.conj().T) + self.between(left(g) for g in self.range.samples)
        return replace(self.range.samples[0].compliance, static=0.5 * (static + static.conj().T))

    def _damping(self, reduced: Reduced) -> Array:
        """Rayleigh's damping matrix is affine in K; the other ratios belong to the mode's number."""
        first = self.range.samples[0]
        if not self.basis.damping_source.startswith("rayleigh"):
            return first.damping_ratio[: len(reduced.omega)]
        alpha, beta = _rayleigh(self.basis.damping_source)
        return 0.5 * (alpha / reduced.omega + beta * reduced.omega)

    def _reduced(self) -> Reduced:
        """The body file's reduction, within the common coordinates."""
        labels = self.range.samples[0].compliance.labels
        exact = [i for i, label in enumerate(labels) if not label.startswith("monitor:")]
        T = self.T[exact]
        values, Y = self.modes
        values, Y = values[: self.range.count] ** 2, self._definite(Y[:, : self.range.count], values)
        self.problem = Substructure(
            dense_pencil(self.K), values, Y, 0, sp.csr_matrix(T), tuple(labels[i] for i in exact),
            np.linalg.solve(self.K, T.conj().T),
        )  # fmt: skip
        return METHODS[self.basis.reduction](self.problem)

    def _definite(self, Y: Array, omega: Array) -> Array:
        """Modes with the signs and pairs of the convention."""
        Y = canonical.turn_clusters(Y, omega[: Y.shape[1]] ** 2, self.range.lead @ Y)
        phi = self.range.samples[0].phi
        decisive = self.range.lead[: self.range.signs] if self.range.signs else self.range.lead
        if not self.range.signs and phi.shape[0]:
            decisive = phi.reshape(-1, phi.shape[2])[canonical.by_place(self.basis.mesh.points)]
        return Y * canonical.signs(decisive @ Y)


# --- static contacts -----------------------------------------------------------------------------------------------


def _around(r: SpeedRange, speed: float) -> tuple[int, float]:
    """The sample below a speed, and the share of the way to the next one, in the square of the speed."""
    square = r.speeds**2
    i = int(np.clip(np.searchsorted(r.speeds, speed, side="right") - 1, 0, len(square) - 2))
    return i, float((speed**2 - square[i]) / (square[i + 1] - square[i]))


def contacts_between(r: SpeedRange, speed: float) -> dict[str, ContactState]:
    """Forces, pressures and gaps of the closures at a speed, rad/s: straight lines in Omega^2 between two equilibria.

    The load grows with Omega^2, and what is closed changes where it will: a polynomial through all equilibria would
    swing about the speed at which a contact closes. `normal_force_error` says how far to trust it.
    """
    i, share = _around(r, speed)
    low, high = r.samples[i].contacts, r.samples[i + 1].contacts
    return {name: _contact_between(low[name], high[name], share) for name in low if name in high}


def _contact_between(a: ContactState, b: ContactState, share: float) -> ContactState:
    def line(x: Array, y: Array) -> Array:
        return (1 - share) * x + share * y

    force, pressure = line(a.force, b.force), line(a.pressure, b.pressure)
    size, pulls = float(np.linalg.norm(force)), line(np.array(a.normal_force), np.array(b.normal_force))
    total = float(a.areas @ pressure)
    weights = (1 - share) * a.normal_force, share * b.normal_force
    centre = (weights[0] * a.centre + weights[1] * b.centre) / pulls if pulls else line(a.centre, b.centre)
    return replace(
        a, force=force, normal_force=size, centre=centre, pressure=pressure * (size / total if total else 1.0),
        gap=line(a.gap, b.gap), closed_share=float(line(np.array(a.closed_share), np.array(b.closed_share))),
        penetration=max(a.penetration, b.penetration), penalty=max(a.penalty, b.penalty),
    )  # fmt: skip


def normal_force_error(r: SpeedRange, speed: float) -> float:
    """N: what `contacts_between` errs by at the equilibria around a speed where these are left out, at most.

    Left out, an equilibrium is bridged over a wider gap than that in which the speed lies. 0 at an equilibrium, NaN
    where fewer than three are known.
    """
    i, share = _around(r, speed)
    if min(abs(share), abs(1 - share)) < 1e-9:
        return 0.0
    left_out = [j for j in (i, i + 1) if 0 < j < len(r.samples) - 1]
    square, worst = r.speeds**2, float("nan")
    for j in left_out:
        part = (square[j] - square[j - 1]) / (square[j + 1] - square[j - 1])
        for name, c in r.samples[j].contacts.items():
            ends = [r.samples[e].contacts[name].normal_force for e in (j - 1, j + 1)]
            worst = float(np.fmax(worst, abs((1 - part) * ends[0] + part * ends[1] - c.normal_force)))
    return worst


def _rayleigh(source: str) -> tuple[float, float]:
    """alpha in 1/s and beta in s from ``rayleigh alpha=... 1/s beta=... s``."""
    words = source.split()
    found = {w.split("=")[0]: float(w.split("=")[1]) for w in words if "=" in w}
    return found["alpha"], found["beta"]


class Dense(eigen.DirectSolver):
    """A direct solver of small matrices, for reductions within the common coordinates."""

    name = "dense"

    def factorise(self, upper: sp.csr_matrix) -> None:
        A = upper.toarray()
        self.values, self.Q = scipy.linalg.eigh(A, lower=False)

    def solve(self, b: Array) -> Array:
        return self.Q @ ((self.Q.conj().T @ b).T / self.values).T

    def negative(self) -> int:
        return int((self.values < 0).sum())


def dense_pencil(K: Array) -> eigen.Pencil:
    """The pencil of K and the identity."""
    size = float(np.abs(K).sum(axis=1).max())

    def shifted(s: float) -> sp.csr_matrix:
        return sp.csr_matrix(np.triu(K - s * np.eye(len(K))))

    return eigen.Pencil(shifted, lambda x: K @ x, lambda x: x, len(K), size, 1.0, Dense(), dtype=K.dtype.type)
