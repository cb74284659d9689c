"""The speed ranges of a body, one a nodal diameter: `common_coordinates` fed with finite elements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..data import Array, ModalGroup, SpeedRange
from ..errors import UserError
from ..linalg import canonical, eigen
from ..reduction import Reduced
from ..settings.body import BodySettings
from ..units import from_rpm, rpm_text
from .equilibrium import StaticState, equilibrium, stiffness_slope
from .group import assemble_group
from .prepared import Prepared
from .range_basis import Common, Guess, Settled, Solved, common_coordinates, lagrange
from .solution import Searched, Solution, reduced_solution, searched_state
from .spectrum import leading_rows


def body_ranges(
    b: Prepared,
    settled: Mapping[float, StaticState],
    searched: Mapping[float, Mapping[int, Searched]],
) -> dict[int, SpeedRange]:
    """Nodal diameter -> one basis for all speeds of `rotation.range_rpm`. Equilibria are shared.

    Args:
        settled: speed (rad/s) -> equilibria that are known already. searched: speed -> nodal diameter -> modes that
            are, a few more of them than are asked for.

    Raises:
        UserError: instability inside the range. NotConverged: the tolerance cannot be met.
    """
    settings, r = b.settings, b.settings.rotation
    assert r.range_rpm is not None
    if any(c.modes == "closed" for c in settings.closures):
        raise UserError(
            'rotation.range_rpm: closures whose modes are "closed" make the stiffness jump where they close, which no '
            'range can follow; use modes = "open", or rotation.speeds_rpm alone'
        )
    low, high = (from_rpm(v) for v in r.range_rpm)
    b.report(f"speed range {r.range_rpm[0]:g} to {r.range_rpm[1]:g} rpm")
    body, before = _Speeds(b, settled, searched), None
    ranges: dict[int, Common] = {}
    try:
        for k in b.harmonics:
            if b.sector:
                b.report(f"speed range of nodal diameter {k}")
            ranges[k] = before = common_coordinates(
                body.settled(k), body.solve(k), low, high, settings.modes.count, r.range_tolerance, b.report, before,
                thrice=settings.reduction != "eigenmodes",
            )  # fmt: skip
    except UserError as error:
        if error.key == "rotation.speeds_rpm":
            error.key = "rotation.range_rpm"
        raise
    return {k: _range(b, k, common) for k, common in ranges.items()}


@dataclass
class _Speeds:
    """What the speeds and nodal diameters of a range share: equilibria, and solutions where all come at once."""

    b: Prepared
    known: Mapping[float, StaticState]
    searched: Mapping[float, Mapping[int, Searched]]
    states: dict[float, StaticState] = field(default_factory=dict)
    slopes: dict[float, Array] = field(default_factory=dict)  # of the displacements
    pencils: dict[float, Mapping[int, eigen.Pencil]] = field(default_factory=dict)
    slope_pencils: dict[float, Mapping[int, eigen.Pencil]] = field(default_factory=dict)
    solutions: dict[float, Mapping[int, Solution]] = field(default_factory=dict)

    def settled(self, k: int) -> Callable[[float, Guess], Settled]:
        """Equilibrium at a speed; Newton starts from the weighted displacements and slopes of the speeds known."""

        def settle(speed: float, weights: Guess) -> Settled:
            if speed not in self.states:
                self.states[speed] = (
                    self.known[speed] if speed in self.known else self._settle(speed, weights)
                )
                self.pencils[speed] = self.b.pencils(self.states[speed].K)
            smooth = self.b.settings.rotation.prestress == "nonlinear" and not self.b.model.contacts
            slope = (lambda fresh: self._slope(speed, fresh)[k].K) if smooth else None
            return Settled(speed, self.pencils[speed][k], self.states[speed], slope)

        return settle

    def _slope(self, speed: float, fresh: bool) -> Mapping[int, eigen.Pencil]:
        if speed not in self.slope_pencils:
            state, fresh = (
                self.states[speed],
                fresh and speed not in self.known,
            )  # else other speeds came between
            self.slopes[speed], dK = stiffness_slope(self.b.model, state, self.b.solver, fresh)
            self.slope_pencils[speed] = self.b.pencils(dK)
        return self.slope_pencils[speed]

    def _settle(self, speed: float, weights: Guess) -> StaticState:
        start, prestress = None, self.b.settings.rotation.prestress
        if weights:
            u = np.sum([w * self.states[s].u for s, (w, _) in weights.items()], axis=0)
            u += np.sum([v * self.slopes[s] for s, (_, v) in weights.items() if v], axis=0)
            start = StaticState(u, None, [], np.zeros(0), prestress)
        self.b.report(f"equilibrium at {rpm_text(speed)}")
        return equilibrium(self.b.model, speed, prestress, self.b.solver, start, self.b.report)

    def solve(self, k: int) -> Callable[[Settled], Solved]:
        """Certified modes, and with the methods that use them the static answers and fixed-interface modes."""
        more = self.b.with_spares()

        def solve(settled: Settled) -> Solved:
            speed = settled.speed
            if speed not in self.solutions:
                every = self.searched.get(speed) or searched_state(more, self.states[speed])
                self.solutions[speed] = {n: reduced_solution(more, s) for n, s in every.items()}
            s = self.solutions[speed][k]
            shapes = [s.found.vectors]
            if more.settings.reduction not in ("eigenmodes", "macneal"):
                shapes += [s.reduced.vectors, s.answers]
            return Solved(np.hstack(shapes), float(s.found.values[0]), s)

        return solve


def _range(b: Prepared, k: int, common: Common) -> SpeedRange:
    mesh, settings = b.model.d.mesh, b.settings
    phi = b.unknowns(k).expand(common.V, mesh.n_points)
    r, held = settings.rotation, common.held_out
    assert r.range_rpm is not None
    return SpeedRange(
        samples=tuple(_samples(b, k, common, phi)),
        solved=np.array(
            [s.speed in common.solved or s.speed in common.refined for s in common.samples]
        ),
        form=common.form,
        shift=common.shift,
        count=_kept(settings, common),
        lead=leading_rows(b.rows, phi, canonical.by_place(mesh.points))(phi),
        signs=6 if settings.interfaces else 0,
        held=np.array([s.speed in {h.speed for h in held} for s in common.samples]),
        slopes=common.slopes,
        interpolation_error=np.array([h.interpolation for h in held]),
        projection_error=np.array([h.projection for h in held]),
        total_error=np.array([h.total for h in held]),
        tolerance=r.range_tolerance,
        points=from_rpm(np.linspace(*r.range_rpm, r.range_points)),
        gyroscopic=r.gyroscopic,
    )


def _kept(settings: BodySettings, common: Common) -> int:
    if settings.modes.max_frequency is None:
        return settings.modes.count
    return max(s.solution.kept for s in common.solved.values())


def _samples(b: Prepared, k: int, common: Common, phi: Array) -> list[ModalGroup]:
    """The body at each sample in the common coordinates; what does not depend on speed is one array for all."""
    B, labels = b.rows.stacked
    light = replace(b, settings=_light(b.settings), report=lambda _: None)
    T = np.asarray(B @ phi) if labels else np.zeros((0, phi.shape[1]))
    known: Solution = next(iter(common.solved.values())).solution
    out: list[ModalGroup] = []
    for settled, K_r, left in zip(
        common.samples, common.K_r, _missing_compliance(common, T), strict=True
    ):
        values, Y = np.linalg.eigh(K_r)
        omega = np.sqrt(np.maximum(values, 0.0))
        static = T @ np.linalg.solve(K_r, T.conj().T) + left
        solved = common.solved.get(settled.speed)
        s = replace(
            solved.solution if solved else known,
            reduced=Reduced(common.V, ("common",) * len(omega), np.eye(len(omega)), K_r, omega, Y),
            static=0.5 * (static + static.conj().T),
        )
        group = assemble_group(light, settled.state, s, k)
        checks = {
            "orthogonality": common.orthogonality,
            "newton_steps": float(settled.state.iterations),
        }
        if solved:
            checks["certified"] = float(s.found.certified)
        compliance = replace(group.compliance, eigenmodes=None)
        group = replace(group, checks=checks, compliance=compliance, invariants=None)
        out.append(_shared(group, out[0]) if out else group)
    return out


def _missing_compliance(common: Common, T: Array) -> Array:
    """(s, r, r) static compliance that the common coordinates leave out: known where solved, a polynomial between."""
    at = {s.speed: K for s, K in zip(common.samples, common.K_r, strict=True)}
    speeds = sorted(common.solved)
    known = [
        common.solved[s].solution.static - T @ np.linalg.solve(at[s], T.conj().T) for s in speeds
    ]
    weights = [lagrange(np.array(speeds), s.speed, common.shift) for s in common.samples]
    return np.tensordot(np.array(weights), np.array(known), 1)


def _light(settings: BodySettings) -> BodySettings:
    """No gyroscopic modes, and stress modes of all common coordinates at every sample only if asked for."""
    rotation = settings.rotation.model_copy(update={"gyroscopic": False})
    output = settings.output
    if not settings.rotation.range_stress:
        output = output.model_copy(update={"gauss": False, "nodal_stress": False})
    return settings.model_copy(update={"output": output, "rotation": rotation})


def _shared(group: ModalGroup, first: ModalGroup) -> ModalGroup:
    faces = {k: replace(i, shapes=first.interfaces[k].shapes) for k, i in group.interfaces.items()}
    return replace(group, phi=first.phi, interfaces=faces)
