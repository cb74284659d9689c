"""The bolted half pipes of Sextro section 5.7: bending and torsion over the tangential stiffness, and a fit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize

from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.data import Array, ModalBasis
from microslip.frames import rotation
from microslip.harmonic_balance import response

CASE = Path(__file__).parents[1] / "pipeline/cases/bolted-pipes.toml"


@dataclass(frozen=True)
class Joined:
    """Elastic modes of the bolted pipe with sticking contacts.

    Attributes:
        frequency: (m,) Hz. likeness: name -> (m,) MAC with the first bending normal to the split plane (``bending``),
            in it (``sideways``) and the first torsion of a free beam (``torsion``).
    """

    frequency: Array
    likeness: dict[str, Array]

    def of(self, name: str) -> tuple[float, float]:
        """Hz and MAC of the mode that is most like it."""
        i = int(self.likeness[name].argmax())
        return float(self.frequency[i]), float(self.likeness[name][i])


def joined(basis: ModalBasis, tangential: float, ratio: float = 2.0, normal: float = 1e4, **changes: Any) -> Joined:
    """The case with another tangential stiffness a patch (N/m), ratio times stiffer along the normal."""
    settings, _ = load_case(CASE)
    changes |= {"tangential_stiffness": tangential, "normal_stiffness": ratio * tangential}
    contacts = tuple(c.model_copy(update=changes) for c in settings.contacts)
    built = build(settings.model_copy(update={"contacts": contacts}), {"upper": basis, "lower": basis})
    assembly = built.pressed(normal)
    part = assembly.joined(1)
    k = scipy.linalg.block_diag(*[c.stiffness for c in assembly.contacts])
    k = k @ np.linalg.inv(np.eye(part.count) + part.residual @ k)
    K = part.K + part.rows.T @ k @ part.rows
    values, V = scipy.linalg.eigh(0.5 * (K + K.T), part.M)
    frequency = np.sqrt(np.maximum(values, 0)) / (2 * np.pi)
    elastic = frequency > 10.0
    return Joined(frequency[elastic], _likeness(built.bodies["upper"].group.phi, basis, V[:, elastic]))


def _likeness(phi: Array, basis: ModalBasis, V: Array) -> dict[str, Array]:
    """MAC of modes (2 m, p) with those of a free beam, over the nodes of both halves."""
    turn = rotation(np.array([0.0, 1.0, 0.0]), np.pi)
    m, x = phi.shape[2], basis.mesh.points
    places = np.vstack([x, x @ turn.T])
    own = phi @ V[:m]
    shapes = np.concatenate([own, np.einsum("ab,nbp->nap", turn, phi @ V[m:])])
    along = places[:, 1] / np.ptp(places[:, 1]) + 0.5
    bend, twist = free_bending(along), np.cos(np.pi * along)
    zero = np.zeros_like(bend)
    wanted = {
        "bending": np.column_stack([zero, zero, bend]),
        "sideways": np.column_stack([bend, zero, zero]),
        "torsion": np.column_stack([twist * places[:, 2], zero, -twist * places[:, 0]]),
    }
    flat = shapes.reshape(-1, shapes.shape[2])
    return {k: (w.ravel() @ flat) ** 2 / ((w**2).sum() * (flat**2).sum(axis=0)) for k, w in wanted.items()}


def free_bending(x: Array) -> Array:
    """First mode of a free beam, 0 <= x <= 1 (beta l = 4.73004)."""
    b = 4.730040744862704
    sigma = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
    return np.cosh(b * x) + np.cos(b * x) - sigma * (np.sinh(b * x) + np.sin(b * x))


def fitted(basis: ModalBasis, bending: float, ratio: float = 2.0) -> tuple[float, Joined]:
    """Tangential stiffness (N/m a patch) that gives a measured first bending resonance (Hz), and the modes with it.

    Raises:
        ValueError: no stiffness from 1e6 to 1e11 N/m does.
    """

    def missed(log: float) -> float:
        return joined(basis, float(np.exp(log)), ratio).of("bending")[0] - bending

    k = float(np.exp(scipy.optimize.brentq(missed, np.log(1e6), np.log(1e11), rtol=1e-6)))
    return k, joined(basis, k, ratio)


def table_of(basis: ModalBasis, stiffnesses: tuple[float, ...]) -> list[list[str]]:
    """Rows of stiffness, bending and torsion with the modes' likeness."""
    rows = []
    for k in stiffnesses:
        j = joined(basis, k)
        rows.append([f"{k:.3g}", *(f"{f:.0f} ({mac:.2f})" for f, mac in (j.of("bending"), j.of("torsion")))])
    return rows


def picture(basis: ModalBasis, left: Any, right: Any) -> None:
    """Bending and torsion over the tangential stiffness; the friction response of the case."""
    k = np.geomspace(1e6, 1e11, 26)
    found = [joined(basis, float(one)) for one in k]
    for name, style in (("bending", "o-"), ("torsion", "s-")):
        left.semilogx(k, [j.of(name)[0] for j in found], style, ms=3.5, label=name)
    left.axvline(1.85e8, color="0.4", ls=":", label="the case")
    left.set(xlabel="tangential stiffness of a patch in N/m", ylabel="frequency in Hz", ylim=(0, 2200))
    left.legend()
    settings, _ = load_case(CASE)
    few = tuple(c.model_copy(update={"points": (2, 2)}) for c in settings.contacts)
    built = build(settings.model_copy(update={"contacts": few}), {"upper": basis, "lower": basis})
    sweep = settings.sweep
    f = np.linspace(sweep.start, sweep.stop, 201)
    problem = problem_of(built, 1e4, samples=16, periodicity=1e-4, cycles=10)
    answer = response.harmonic_response(problem, f)
    right.semilogy(f, 1e6 * answer.columns()["amplitude_m"], lw=1.5, label="10 kN a bolt")
    right.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the end in µm, 20 N")
    right.legend()
