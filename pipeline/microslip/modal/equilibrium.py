"""The static state of a rotating, heated, loaded body, and the stiffness about it.

The book's Eq. (2.3-28) keeps only the centrifugal softening: taken literally frequencies fall with speed. Here
the state is solved for with finite displacements (St Venant-Kirchhoff material, load following r + u, dead
pressures) and the tangent is taken about it: A = F C F^T + S, minus Omega^2 M P (docs/errata.md, docs/modes.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from ..data import Array, Indices, Material, Mesh
from ..elasticity import VOIGT_AXES, pushed, strain_tensor
from ..errors import NotConverged, UserError
from ..fem.contact import ContactPair, Grip
from ..fem.cyclic import CyclicUpper
from ..fem.discretise import Block, Discretisation, FreeUpper, Pattern, quadrature, whole
from ..fem.line_springs import LineSprings, line_springs
from ..fem.loads import FollowingPressure
from ..fem.operators import (
    displacement_gradient,
    engineering,
    green_strain,
    internal_force,
    mass,
    per_block,
    spin_projector,
    stiffness,
    tangent,
    tangent_tensor,
    tangent_tensor_slope,
    to_symmetric,
)
from ..fem.tied import Tied
from ..interrupts import look
from ..linalg.direct import DirectSolver
from ..linalg.eigen import Unstable, symmetric_product
from ..progress import Report
from ..units import rpm_text
from .closing import Closing


class Expandable(Protocol):
    """What a pencil's unknowns mean on the mesh, or on the rows of foreign matrices (`modal.foreign.Layout`)."""

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n, r) displacements of n points from the unknowns (m, r)."""

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns, from rows (r, 3n) on all degrees of freedom."""


class Unknowns(Expandable, Protocol):
    """Those of a mesh: `FreeUpper`, `Tied`, `modal.sector.HarmonicUnknowns`."""

    def restrict(self, forces: Array) -> Array:
        """(m, r) forces on the unknowns, from forces (3n, r)."""

    def unknowns_of(self, displacements: Array) -> Array:
        """(m, r) unknowns of displacements (3n, r)."""


@dataclass(frozen=True)
class BodyModel:
    """A discretised body with everything that does not depend on speed.

    Attributes:
        d: the discretisation. materials: one per block. factor: per block (e, q) modulus over the reference one, or
        None. thermal_strain: per block (e, q, 6) alpha dT, or None. M: (p,) scalar mass over the pattern, kg.
        M_full: (n, n). K0: (p, 3, 3) stiffness of the stress-free body, N/m. free: map to the free degrees of freedom.
        dead_load: (n, 3) forces that act at every speed, N. axis, point: of rotation.
        spin_softening: whether -Omega^2 M P is part of K. contacts: faces that may touch in the static state.
        hooke: per block (6, 6) or (e, q, 6, 6) that takes the place of the materials' (see `heated`), or None.
        springs, dashpots: (p, 3, 3) of the mesh's lumped elements, N/m and N s/m, or None. lines:
        springs that turn.
        following: pressures that follow the surface. displaced: (n, 3) m, displacements that are prescribed, continued
            as the ties want it and 0 elsewhere, or None.
    """

    d: Discretisation
    materials: tuple[Material, ...]
    factor: list[Array] | None
    thermal_strain: list[Array] | None
    M: Array
    M_full: sp.csr_matrix
    K0: Array
    free: FreeUpper | Tied | CyclicUpper
    fixed: Indices
    dead_load: Array
    axis: Array
    point: Array
    spin_softening: bool = True
    contacts: tuple[ContactPair, ...] = ()
    hooke: list[Array] | None = None
    springs: Array | None = None
    dashpots: Array | None = None
    lines: LineSprings | None = None
    following: tuple[FollowingPressure, ...] = ()
    displaced: Array | None = None

    def elasticity(self, block: int) -> Array:
        """(6, 6) or (e, q, 6, 6) Hooke matrix of a block's points, Pa, without `factor`."""
        return self.materials[block].elasticity if self.hooke is None else self.hooke[block]

    @property
    def factors(self) -> Sequence[Array | None]:
        """`factor` of each block."""
        return [None] * len(self.d.blocks) if self.factor is None else self.factor

    @property
    def loaded(self) -> bool:
        """True if something acts on the body at rest."""
        given = self.thermal_strain is not None or self.displaced is not None
        return given or bool(np.any(self.dead_load)) or bool(self.contacts or self.following)

    def following_force(self, x: Array) -> Array | float:
        """(n, 3) N of the pressures that follow the surface, at positions x."""
        return sum((p.force(x) for p in self.following), start=0.0)

    def following_stiffness(self, x: Array) -> Array | float:
        """(p, 3, 3) N/m of these."""
        return sum((p.stiffness(x, self.d.pattern) for p in self.following), start=0.0)


@dataclass(frozen=True)
class StaticState:
    """Equilibrium and the stiffness about it.

    Attributes:
        u: (n, 3) m. H: per block displacement gradients (e, q, 3, 3), None if the reference geometry is used.
        stress: per block (e, q, 6) second Piola-Kirchhoff stress, Pa. K: (p, 3, 3) stiffness about the state with
        the centrifugal softening, N/m: without the stiffness of contacts, whose forces stay as dead loads, but for
        those that stay closed; of a cyclic sector without those between neighbours, which depend on the nodal
        diameter (`sector.contact_between`). prestress: ``none``, ``linear``, ``nonlinear``. iterations: of Newton.
        contacts: as they press in the state. speed: rad/s.
    """

    u: Array
    H: list[Array] | None
    stress: list[Array]
    K: Array
    prestress: str
    iterations: int = 0
    contacts: tuple[Grip, ...] = ()
    speed: float = 0.0


def make_model(
    d: Discretisation, material: Material | Sequence[Material], free: FreeUpper | Tied | CyclicUpper, fixed: Indices,
    axis: Array, point: Array, temperature: Array | None, reference: float, dead_load: Array, spin_softening: bool,
) -> BodyModel:  # fmt: skip
    """Assemble what does not depend on speed.

    Args:
        material: one for all, or one per block. temperature: (n,) K at the nodes, (n, 2) with the
            stress-free one behind it, or None for the reference.
    """
    own: list[Material] = per_block(d, material)
    factor = strain = hooke = None
    if temperature is not None:
        alike = np.full(len(temperature), reference)
        T = temperature if temperature.ndim == 2 else np.column_stack([temperature, alike])
        both = [np.einsum("qk,eks->seq", _heat_shapes(b), T[b.cells]) for b in d.blocks]
        at, cold = [t[0] for t in both], [t[1] for t in both]
        if any(m.temperature_table is not None for m in own):
            factor = [m.modulus_factor(t) for m, t in zip(own, at, strict=True)]
        if any(np.any(m.expansion) for m in own):
            strain = [m.thermal_strain(t, free) for m, t, free in zip(own, at, cold, strict=True)]
        if any(m.stiffness_table is not None for m in own):
            hooke = [
                m.elasticity if m.stiffness_table is None else m.stiffness_at(t)
                for m, t in zip(own, at, strict=True)
            ]
    M = mass(whole(d), [m.density for m in own])
    if hooke is None:
        K = stiffness(d, [m.elasticity for m in own], factor)
    else:
        of_each = zip(
            hooke, [None] * len(hooke) if factor is None else factor, d.blocks, strict=True
        )
        K = tangent(
            d, [tangent_tensor(C, f, None, np.zeros((*b.dx.shape, 6))) for C, f, b in of_each]
        )
    return BodyModel(
        d, tuple(own), factor, strain, M, d.pattern.full(M), K, free, fixed,
        dead_load, axis / np.linalg.norm(axis), point, spin_softening, hooke=hooke,
    )  # fmt: skip


def _heat_shapes(b: Block) -> Array:
    """(q, k) temperature at a block's points by those at its nodes.

    In bricks of 20 nodes it is the trilinear field nearest to the quadratic one, in bricks of 8 the
    mean: what heat strains is then no finer than the strains they have (so does CalculiX).
    """
    if b.cell_type == "hexahedron":
        return np.full(b.N.shape, 1 / 8)
    if b.cell_type != "hexahedron20":
        return b.N
    x, y, z = (b.at - b.at.mean(axis=0)).T
    A = np.column_stack([np.ones(len(x)), x, y, z, x * y, y * z, x * z, x * y * z])
    weighted = A.T * quadrature(b.cell_type, 3 if len(b.at) == 8 else None)[1]
    return A @ np.linalg.solve(weighted @ A, weighted @ b.N)


def with_lumps(model: BodyModel) -> BodyModel:
    """The model with the point masses, springs and dashpots of its mesh."""
    if (lumps := model.d.mesh.lumps) is None:
        return model
    pattern, M = model.d.pattern, model.M.copy()
    np.add.at(M, pattern.places(lumps.points, lumps.points), lumps.masses)
    springs, dashpots = lumped_springs(model.d.mesh, pattern), np.zeros((pattern.size, 3, 3))
    np.add.at(dashpots, pattern.places(*lumps.pairs.T), lumps.damping)
    return replace(
        model, M=M, M_full=pattern.full(M), K0=model.K0 + springs, springs=springs,
        dashpots=dashpots if dashpots.any() else None, lines=line_springs(model.d.mesh),
    )  # fmt: skip


def lumped_springs(mesh: Mesh, pattern: Pattern) -> Array:
    """(p, 3, 3) stiffness of the lumped elements of a mesh over a pattern, N/m."""
    K = np.zeros((pattern.size, 3, 3))
    if mesh.lumps is not None:
        np.add.at(K, pattern.places(*mesh.lumps.pairs.T), mesh.lumps.stiffness)
    return K


def resisting_force(model: BodyModel, stress: list[Array], H: list[Array] | None, u: Array) -> Array:
    """(n, 3) forces with which stress and springs resist displacements u (n, 3), N."""
    force = internal_force(model.d, stress, H)
    if model.springs is not None:
        force = force + (model.d.pattern.full(model.springs) @ u.reshape(-1)).reshape(u.shape)
    return force if model.lines is None or H is None else force + model.lines.force(u)


def stress_of(model: BodyModel, strain: list[Array]) -> list[Array]:
    """Per block (e, q, 6) stress of a strain, less the thermal strain, Pa."""
    out = []
    for i, e in enumerate(strain):
        elastic = e if model.thermal_strain is None else e - model.thermal_strain[i]
        s = _stress(model.elasticity(i), elastic)
        out.append(s if model.factor is None else s * model.factor[i][..., None])
    return out


def _stress(C: Array, strain: Array) -> Array:
    return strain @ C.T if C.ndim == 2 else np.matmul(C, strain[..., None])[..., 0]


def thermal_stretch(model: BodyModel, block: int) -> Array:
    """(e, q, 3, 3) U = 1 + alpha dT: what heat makes of the free material."""
    assert model.thermal_strain is not None
    return np.eye(3) + strain_tensor(model.thermal_strain[block])


def heated(model: BodyModel) -> BodyModel:
    """The model for finite displacements: heat stretches the material by U, and Hooke's law holds from there on.

    F = F_e U with the energy 1/2 E_e : C : E_e of the unit of heated volume, E_e the Green-Lagrange strain of F_e
    (V. A. Lubarda, Appl. Mech. Rev. 57, 2004). Then S = C' : (E - (U^2 - 1)/2), C'_IJKL = det U V_Ii V_Jj V_Kk V_Ll
    C_ijkl with V = U^-1; where the material expands alike in all directions, by 1 + a, C' = C / (1 + a).
    """
    if model.thermal_strain is None:
        return model
    strain, hooke, factor = [], [], []
    for i, (m, e) in enumerate(zip(model.materials, model.thermal_strain, strict=True)):
        U, own = thermal_stretch(model, i), np.ones(e.shape[:-1]) if model.factor is None else model.factor[i]
        strain.append(engineering(0.5 * (U @ U - np.eye(3))))
        alike = np.array_equal(m.expansion, m.expansion[0] * np.array([1, 1, 1, 0, 0, 0]))
        C = model.elasticity(i)
        hooke.append(C if alike else pushed(C, np.linalg.inv(U)))
        factor.append(own / U[..., 0, 0] if alike else own)
    return replace(model, thermal_strain=strain, hooke=hooke, factor=factor)


def softening(model: BodyModel, speed: float) -> Array:
    """(p, 3, 3) -Omega^2 M P of Sextro Eq. (2.3-29)."""
    return -(speed**2) * model.M[:, None, None] * spin_projector(model.axis)


def centrifugal_force(model: BodyModel, speed: float, u: Array) -> Array:
    """(n, 3) Omega^2 M P (x + u - point), N."""
    position = model.d.mesh.points + u - model.point
    return speed**2 * (model.M_full @ (position @ spin_projector(model.axis)))


def equilibrium(
    model: BodyModel, speed: float, prestress: str, solver: DirectSolver, start: StaticState | None = None,
    report: Report = lambda _: None,
) -> StaticState:  # fmt: skip
    """The static state at a speed and the stiffness about it.

    Args:
        speed: rad/s. prestress: ``none``, ``linear`` or ``nonlinear``. solver: keeps its analysis.
        start: a neighbouring state to begin Newton from.

    Raises:
        UserError: the body is unstable at this speed (negative stiffness).
        NotConverged: Newton did not converge.
    """
    n = model.d.mesh.n_points
    zero = [np.zeros((*b.dx.shape, 6)) for b in model.d.blocks]
    if speed == 0 and not model.loaded:
        return StaticState(np.zeros((n, 3)), None, zero, model.K0, prestress)
    soft = softening(model, speed) if model.spin_softening else 0.0
    if prestress == "none":
        return StaticState(np.zeros((n, 3)), None, zero, model.K0 + soft, prestress, speed=speed)
    if prestress == "linear":
        return _linear(model, speed, solver, soft)
    return _newton(model, speed, solver, start, report)


def _linear(model: BodyModel, speed: float, solver: DirectSolver, soft: Array | float) -> StaticState:
    """One linear solution; then K_u (displaced geometry) + K_sigma + softening, as CalculiX's PERTURBATION step."""
    n = model.d.mesh.n_points
    x, first = model.d.mesh.points, np.zeros((n, 3)) if model.displaced is None else model.displaced
    force = model.dead_load + centrifugal_force(model, speed, np.zeros((n, 3))) + model.following_force(x)
    if model.thermal_strain is not None or model.displaced is not None:
        force = force - resisting_force(model, _small(model, first)[1], None, first)
    solver.factorise(model.free.matrix(model.K0))
    u = first + model.free.expand(solver.solve(model.free.restrict(force.reshape(-1))), n).reshape(n, 3)
    H, stress = _small(model, u)
    K = _tangent(model, H, stress, u) + soft + model.following_stiffness(x + u)
    return StaticState(u, H, stress, K, "linear", speed=speed)


def _small(model: BodyModel, u: Array) -> tuple[list[Array], list[Array]]:
    """Displacement gradients, and the stress of small strains, per block."""
    H = [displacement_gradient(b, u) for b in model.d.blocks]
    return H, stress_of(model, [green_strain(h, nonlinear=False) for h in H])


def _continued(model: BodyModel, solver: DirectSolver) -> Array:
    """(n, 3) m: prescribed displacements as the stress-free body follows them, linearly."""
    n, cold = model.d.mesh.n_points, replace(model, thermal_strain=None)
    if model.displaced is None:
        return np.zeros((n, 3))
    force = resisting_force(cold, _small(cold, model.displaced)[1], None, model.displaced)
    solver.factorise(model.free.matrix(model.K0))
    answer = model.free.expand(solver.solve(model.free.restrict(force.reshape(-1))), n)
    return model.displaced - answer.reshape(n, 3)


def stiffness_slope(
    model: BodyModel, state: StaticState, solver: DirectSolver, fresh: bool = False
) -> tuple[Array, Array]:
    """(n, 3) du/dOmega^2 and (p, 3, 3) dK/dOmega^2 along the equilibria through a nonlinear state without contacts.

    K du = M P (x + u), from the balance of forces; dK is the derivative of the tangent along du.

    Args:
        fresh: the solver is as Newton left it, factorised within its last steps of K; else it is factorised here.
    """
    model, free, n = heated(model), model.free, model.d.mesh.n_points
    K = free.matrix(state.K if model.spin_softening else state.K + softening(model, state.speed))
    if not (fresh and state.iterations):
        solver.factorise(K)
    force = free.restrict(centrifugal_force(model, 1.0, state.u).reshape(-1))
    du = free.expand(_refined(solver, symmetric_product(K), force), n).reshape(n, 3)
    slope = _tangent_slope(model, state, du)
    return du, slope + softening(model, 1.0) if model.spin_softening else slope


def _refined(solver: DirectSolver, K: Callable[[Array], Array], force: Array) -> Array:
    """Solution of K x = force with the factors of a matrix close to K."""
    x = solver.solve(force)
    for _ in range(20):
        step = solver.solve(force - K(x))
        x = x + step
        if np.abs(step).max() <= 1e-9 * np.abs(x).max():
            break
    return x


def _tangent_slope(model: BodyModel, state: StaticState, du: Array) -> Array:
    """(p, 3, 3) derivative of the tangent along du (n, 3), m: that of A = F C F^T + S, with dS = C : sym(F^T dH)."""
    H = state.H or [np.zeros((*b.dx.shape, 3, 3)) for b in model.d.blocks]
    A = []
    for i, (b, f, h) in enumerate(zip(model.d.blocks, model.factors, H, strict=True)):
        C = model.elasticity(i)
        dH = displacement_gradient(b, du)
        E = np.swapaxes(np.eye(3) + h, -1, -2) @ dH
        stress = _stress(C, engineering(0.5 * (E + np.swapaxes(E, -1, -2))))
        A.append(tangent_tensor_slope(C, f, h, dH, stress if f is None else stress * f[..., None]))
    K = tangent(model.d, A)
    return K if model.lines is None else K + model.lines.slope(state.u, du, model.d.pattern)


def _tangent(model: BodyModel, H: list[Array], stress: list[Array], u: Array) -> Array:
    parts = enumerate(zip(model.factors, H, stress, strict=True))
    K = tangent(model.d, [tangent_tensor(model.elasticity(i), *part) for i, part in parts])
    K = K if model.springs is None else K + model.springs
    return K if model.lines is None else K + model.lines.tangent(u, model.d.pattern)


def _newton(
    model: BodyModel, speed: float, solver: DirectSolver, start: StaticState | None, report: Report
) -> StaticState:
    """Full Newton; where it fails the load is applied in halved steps from the last good state."""
    if start is not None:
        try:
            return _newton_at(model, speed, 1.0, solver, start)
        except NotConverged:
            report("static state: starting again from rest")
    good: StaticState | None = None
    level, step, total = 0.0, 1.0, 0
    given = _continued(model, solver)
    while level < 1.0:
        target = min(level + step, 1.0)
        try:
            begun = None if good is None else replace(good, u=good.u + (target - level) * given)
            state = _newton_at(model, speed, target, solver, begun, target * given)
        except NotConverged as error:
            step *= 0.5
            if step < 1 / 64:
                if not isinstance(error, Unstable):
                    raise error from None
                raise _unstable(model, speed, error.count) from None
            continue
        total += state.iterations
        report(f"static state: {100 * target:.0f} % of the load after {total} Newton steps")
        good, level = state, target
    return replace(state, iterations=total)


def _newton_at(
    model: BodyModel, speed: float, level: float, solver: DirectSolver, start: StaticState | None,
    given: Array | float = 0.0,
) -> StaticState:  # fmt: skip
    """Newton at a share `level` of all loads, until steps are below 1e-9 of u, or small and no longer falling.

    Small steps that fall tenfold are taken with the factors at hand, but for contacts. A millionth of the body stands
    for u where less moves: heated between walls a body does not move at all. With contacts the pressures must stand
    too.
    """
    n, free = model.d.mesh.n_points, model.free
    omega = speed * np.sqrt(level)
    soft = softening(model, omega)
    if model.thermal_strain is not None and level < 1:
        model = replace(model, thermal_strain=[level * e for e in model.thermal_strain])
    model = heated(model)
    steps: list[float] = []
    points = model.d.mesh.points
    size = float(np.ptp(points, axis=0).max())
    u = np.zeros((n, 3)) + given if start is None else start.u
    closing = Closing(model.contacts, points + u, level, () if start is None else start.contacts)
    for _ in range(60 if model.contacts else 25):
        look()
        H = [displacement_gradient(b, u) for b in model.d.blocks]
        stress = stress_of(model, [green_strain(h) for h in H])
        closing.move(points + u, steps[-1] if steps else np.inf)
        if _stands(steps) and closing.settled:
            if any((np.linalg.det(np.eye(3) + h) <= 0).any() for h in H):
                break  # in balance, but turned inside out
            whole = not isinstance(free, CyclicUpper)  # of a sector neighbours count by nodal diameter (`sector`)
            K = _tangent(model, H, stress, u) + level * model.following_stiffness(points + u)
            K = closing.stiffened(K + soft if model.spin_softening else K, model.d.pattern, True, whole)
            return StaticState(u, H, stress, K, "nonlinear", len(steps), closing.grips, omega)
        pushed = level * (model.dead_load + model.following_force(points + u))
        outer = closing.with_forces(pushed + centrifugal_force(model, omega, u))
        residual = free.restrict((outer - resisting_force(model, stress, H, u)).reshape(-1))
        if model.contacts or not _factors_serve(steps):
            K = _tangent(model, H, stress, u) + level * model.following_stiffness(points + u)
            solver.factorise(free.matrix(closing.stiffened(K + soft, model.d.pattern)))
            if (negative := solver.negative()) and len(steps) > 3:
                raise Unstable(negative)  # perhaps only on the way: smaller load steps will tell
        unknowns = solver.solve(residual)
        change = free.expand(unknowns, n).reshape(n, 3)
        steps.append(float(np.abs(change).max() / max(np.abs(u + change).max(), 1e-6 * size)))
        u = u + closing.share(points + u, change, steps[-1], float(residual @ unknowns)) * change
        if not np.isfinite(steps[-1]) or np.abs(u).max() > 1e3 * size:
            break
    raise NotConverged(
        f"no static equilibrium was found at {rpm_text(speed)}; lower the speed or the loads, or use "
        'rotation.prestress = "linear" to see whether the state is plausible'
    )


def _stands(steps: list[float]) -> bool:
    """A step is below 1e-9 of u, the next one would be though it fell no faster than the last, or rounding rules."""
    falling = len(steps) < 2 or steps[-1] <= 0.3 * steps[-2]
    if falling:
        return bool(steps) and (steps[-1] < 1e-9 or (len(steps) > 1 and steps[-1] ** 2 < 1e-9 * steps[-2]))
    return steps[-1] < 1e-5


def _factors_serve(steps: list[float]) -> bool:
    """Whether the next step may be taken with the factors of the last one: it was small, and they serve it well."""
    return bool(steps) and steps[-1] < 1e-3 and (len(steps) < 2 or steps[-1] <= 0.1 * steps[-2])


def _unstable(model: BodyModel, speed: float, count: int) -> UserError:
    why = "buckling or centrifugal divergence); lower the speed or the loads" if speed else "buckling); lower them"
    text = f"the body is unstable (its stiffness has {count} negative directions: {why}"
    return UserError(f"at {rpm_text(speed)} {text}", what_loads(model, speed))


def what_loads(model: BodyModel, speed: float) -> str:
    """The key of body.toml behind the stresses of a state: of the first that is given, the speed before all others."""
    if speed:
        return "rotation.speeds_rpm"
    if np.any(model.dead_load) or model.following or model.displaced is not None:
        return "loads"
    return "temperature" if model.thermal_strain is not None else "closures"


def cauchy(state: StaticState, block: int) -> Array:
    """(e, q, 6) Cauchy stress F S F^T / det F, Pa; of a linear solution its stress C : epsilon as it is."""
    if state.H is None or state.prestress == "linear":
        return state.stress[block]
    F = np.eye(3) + state.H[block]
    S = to_symmetric(state.stress[block])
    sigma = np.matmul(np.matmul(F, S), np.swapaxes(F, -1, -2)) / np.linalg.det(F)[..., None, None]
    return sigma[..., *VOIGT_AXES]
