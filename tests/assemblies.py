"""Random assemblies as the files of a case; the same ones turned, mirrored, in other units, or in a ring.

Bodies by hand are a hull that turns and a tip beside it, on springs that couple all of their nine coordinates; bodies
of finite elements are two beams side by side. Both are drawn in the axes of the case and written in axes of their own,
from which `turn` and `shift` of the case bring them back.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
import small
from attack import toml
from decks import mesh_lines

from microslip.data import Array, Mesh
from microslip.frames import rotation, skew

Y = np.array([0.0, 1.0, 0.0])
Raw = dict[str, Any]


@dataclass
class Drawn:
    """An assembly in the axes of the case: system.toml of every body, case.toml, and where each body stands (degrees
    about y, m) against the axes that its file is in."""

    systems: dict[str, Raw]
    case: Raw
    places: dict[str, tuple[float, Array]] = field(default_factory=dict)

    def written(self, folder: Path) -> Path:
        """The files in a folder; the path of the case."""
        case = copy.deepcopy(self.case)
        for b in case["bodies"]:
            turn, shift = self.places.get(b["name"], (0.0, np.zeros(3)))
            back = rotation(Y, -np.radians(turn))
            b |= {"turn": turn, "shift": shift}
            (folder / b["name"]).mkdir(parents=True, exist_ok=True)
            system = moved(self.systems[b["name"]], back, -back @ shift)
            (folder / b["name"] / "system.toml").write_text(toml(system))
        (folder / "case.toml").write_text(toml(case))
        return folder / "case.toml"


def moved(system: Raw, Q: Array, shift: Array) -> Raw:
    """A system turned, or mirrored (3, 3), and then shifted (m)."""
    out, axial = copy.deepcopy(system), np.linalg.det(Q) * Q
    for key in ("masses", "bodies", "contacts", "forces", "monitors"):
        for item in out[key]:
            item |= {k: Q @ item[k] + shift for k in ("at",) if k in item}
            item |= {k: Q @ item[k] for k in ("normal", "t2", "direction") if k in item}
    T = scipy.linalg.block_diag(Q, Q, axial)
    K = T @ out["matrices"]["stiffness"] @ T.T
    out["matrices"]["stiffness"] = 0.5 * (K + K.T)
    return out


def unit(rng: np.random.Generator) -> Array:
    found = rng.normal(size=3)
    return found / np.linalg.norm(found)


def system(rng: np.random.Generator, name: str) -> Raw:
    """A body without contacts, its first resonances about 100 to 200 Hz."""
    at, beside = 0.05 * rng.normal(size=(2, 3))
    relative = np.hstack([np.eye(3), -np.eye(3), skew(beside)])
    one, other = rng.normal(size=(3, 3)), rng.normal(size=(6, 6)) / 8
    size = np.sqrt(np.r_[rng.uniform(3e5, 9e5, 3), rng.uniform(1e3, 4e3, 3)])
    K = relative.T @ (2e5 * (np.eye(3) + 0.2 * one @ one.T)) @ relative
    K[3:, 3:] += size[:, None] * (np.eye(6) + 0.5 * (other + other.T)) * size
    return {
        "name": name,
        "masses": [{"name": "tip", "mass": 0.1, "at": at + beside}],
        "bodies": [{"name": "hull", "mass": 0.5, "inertia": [1e-3] * 3, "at": at}],
        "matrices": {"mass": np.zeros((9, 9)), "stiffness": 0.5 * (K + K.T)},
        "damping_ratio": float(rng.uniform(0.02, 0.06)),
        "contacts": [],
        "forces": [{"name": "push", "on": "tip", "direction": unit(rng)},
                   {"name": "shake", "on": "hull", "direction": unit(rng), "at": at + 0.02 * rng.normal(size=3)}],
        "monitors": [{"name": "probe", "on": "tip"}, {"name": "eye", "on": "hull", "at": at + 0.02 * unit(rng)}],
    }  # fmt: skip


def law(rng: np.random.Generator, rough: bool) -> Raw:
    """Springs, friction and points of a contact."""
    own = {"law": "rough", "roughness": float(rng.uniform(2e-5, 4e-5))} if rough else {"law": "smooth"}
    k = float(rng.uniform(5e5, 2e6))
    return own | {"normal_stiffness": k, "tangential_stiffness": float(rng.uniform(0.4, 0.8)) * k,
                  "friction": float(rng.uniform(0.1, 0.4)), "points": [2, 2], "includes": "surface"}  # fmt: skip


def touch(rng: np.random.Generator, drawn: Drawn, one: str, other: str | None, rough: bool) -> None:
    """One more contact of a body with another one, or with the ground, at a place of its own."""
    at, normal, name = 0.05 * rng.normal(size=3), unit(rng), f"to_{other or 'ground'}"
    size = {"width": float(rng.uniform(0.01, 0.02)), "height": float(rng.uniform(0.01, 0.02))}
    tangent = np.cross(normal, unit(rng))
    face = {"on": "hull", "at": at} | size
    drawn.systems[one]["contacts"].append(face | {"name": name, "normal": normal, "t2": tangent})
    contact = {"interface": f"{one}:{name}"} | law(rng, rough)
    if other is not None:
        across = float(rng.choice([-1.0, 1.0])) * tangent
        drawn.systems[other]["contacts"].append(face | {"name": f"to_{one}", "normal": -normal, "t2": across})
        contact["against"] = f"{other}:to_{one}"
    pressed = rng.integers(3)
    if pressed:
        contact |= {"normal_force": float(rng.uniform(15, 40))} if pressed == 1 else {"interference": 3e-5}
    drawn.case["contacts"].append(contact)


def draw(seed: int, rough: bool = False, harmonics: int = 2, samples: int = 32, hard: float = 1.0) -> Drawn:
    """Two to four bodies in a row, the first one or two of them on the ground besides.

    Args:
        rough: whether some contacts are. hard: factor on the loads.
    """
    rng = np.random.default_rng(seed)
    names = list("abcd"[: rng.integers(2, 5 if hard > 1 else 4)])
    drawn = Drawn({n: system(rng, n) for n in names}, {"name": "drawn", "harmonics": harmonics, "samples": samples})
    drawn.case |= {"bodies": [{"name": n} for n in names], "contacts": []}
    for one, other in zip(names, names[1:], strict=False):
        touch(rng, drawn, one, other, rough and bool(rng.integers(2)))
    for one in names[: rng.integers(0, 5 - len(names))]:
        touch(rng, drawn, one, None, rough)
    drawn.case["excitations"] = [
        {"row": f"{names[i % len(names)]}:{('push', 'shake')[i % 2]}", "amplitude": hard * float(rng.uniform(5, 15)),
         "phase": float(rng.uniform(0, 360)) * (h > 0), "harmonic": h}
        for i, h in enumerate([1, int(rng.integers(0, harmonics + 1)), 1][: rng.integers(1, 4)])
    ]  # fmt: skip
    asked = [(n, m, d) for n in names for m in ("probe", "eye") for d in "xyz"]
    some = rng.choice(len(asked), rng.integers(2, 5), replace=False)
    drawn.case["monitors"] = [{"monitor": f"{asked[i][0]}:{asked[i][1]}", "direction": asked[i][2]} for i in some]
    start = float(rng.uniform(90, 130))
    drawn.case["sweep"] = {"start": start, "stop": start + 50.0, "points": int(rng.integers(5, 8))}
    drawn.case["sweep"]["normal_forces"] = [float(rng.uniform(15, 40))]
    drawn.places = places(rng, names)
    return drawn


def places(rng: np.random.Generator, names: Iterable[str]) -> dict[str, tuple[float, Array]]:
    """Random ones by whose turns axes become axes, see `Drawn`."""
    return {n: (90.0 * float(rng.integers(4)), rng.normal(size=3)) for n in names}


def turned(drawn: Drawn, Q: Array, places: dict[str, tuple[float, Array]]) -> Drawn:
    """The whole assembly turned, or mirrored (3, 3), its bodies written in axes that stand at other places."""
    systems = {n: moved(s, Q, np.zeros(3)) for n, s in drawn.systems.items()}
    return Drawn(systems, copy.deepcopy(drawn.case), places)


# rings --------------------------------------------------------------------------------------------------------------

RADIUS = 0.3  # m, at which neighbours touch


def ring(seed: int, blades: int, order: int, harmonics: int = 2, samples: int = 32, damper: bool = False) -> Drawn:
    """A blade that touches its neighbours in a ring; a damper on it besides that reaches to the next blade.

    Args:
        blades: N. order: engine order of the first harmonic.
    """
    rng = np.random.default_rng(seed)
    drawn = Drawn({"blade": system(rng, "blade")}, {"name": "ring", "harmonics": harmonics, "samples": samples})
    drawn.case |= {"ring": {"blades": blades, "engine_order": order}, "bodies": [{"name": "blade"}], "contacts": []}
    _gap(rng, drawn, blades, "blade", "blade", "shroud")
    if damper:
        drawn.systems["damper"] = system(rng, "damper")
        drawn.case["bodies"].append({"name": "damper"})
        touch(rng, drawn, "damper", "blade", False)
        _gap(rng, drawn, blades, "damper", "blade", "foot")
    bodies = list(drawn.systems)
    drawn.case["excitations"] = [
        {"row": f"{b}:{x}", "amplitude": float(rng.uniform(5, 15)), "phase": float(rng.uniform(0, 360)),
         "engine_order": h * order}
        for b, x, h in zip(bodies, ("push", "shake"), (1, int(rng.integers(1, harmonics + 1))), strict=False)
    ]  # fmt: skip
    drawn.case["excitations"].append({"row": "blade:shake", "amplitude": 3.0, "harmonic": 0})
    drawn.case["monitors"] = [{"monitor": f"{b}:{m}", "direction": d} for b in bodies
                              for m, d in (("probe", "x"), ("eye", "z"))]  # fmt: skip
    start = float(rng.uniform(90, 130))
    drawn.case["sweep"] = {"start": start, "stop": start + 50.0, "points": 5, "normal_forces": [20.0]}
    return drawn


def _gap(rng: np.random.Generator, drawn: Drawn, blades: int, one: str, other: str, name: str) -> None:
    """A contact between a body and one of the next sector."""
    size = {"width": float(rng.uniform(0.01, 0.02)), "height": float(rng.uniform(0.01, 0.02))}
    angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(-0.02, 0.02)
    tangent, at = np.array([0.0, np.cos(angle), np.sin(angle)]), np.array([0.0, away, RADIUS])
    for body, side, sign in ((one, "right", 1.0), (other, "left", -1.0)):
        R = rotation(Y, sign * np.pi / blades)
        face = {"on": "hull", "at": R @ at, "normal": sign * R[:, 0], "t2": R @ tangent}
        drawn.systems[body]["contacts"].append(size | face | {"name": f"{name}_{side}"})
    ends = {"interface": f"{one}:{name}_right", "against": f"{other}:{name}_left", "against_sector": 1}
    drawn.case["contacts"].append(ends | law(rng, False))


# beams of finite elements -------------------------------------------------------------------------------------------

CONTACT = {
    "name": "rub",
    "stiffness": {"kind": "given", "normal": 2e6, "tangential": 1e6, "includes": "surface"},
    "roughness": {"kind": "polynomial", "R_Z": 2e-5},
    "friction": {"kind": "coulomb", "mu": 0.3},
}


@dataclass
class Beams:
    """Two beams side by side, a clamped below and b above, rubbing by a contact.toml under forces and a pressure field;
    a strain gauge is read first, whose sense no turning changes.

    Attributes:
        Q: (3, 3) by which all of it is turned or mirrored. places: see `Drawn`. unit: of length in every file but that
            of the case, which is in SI.
    """

    Q: Array = field(default_factory=lambda: np.eye(3))
    places: dict[str, tuple[float, Array]] = field(default_factory=dict)
    unit: str = "m"
    case: Raw = field(default_factory=lambda: {
        "name": "beams", "harmonics": 2, "samples": 32,
        "monitors": [{"monitor": "a:root"}, *({"monitor": f"{b}:tip", "direction": d} for b in "ab" for d in "xyz")],
        "contacts": [{"interface": "a:right", "against": "b:left", "file": "contact.toml", "points": [2, 2]}],
        "sweep": {"start": 900.0, "stop": 1400.0, "points": 6, "normal_forces": [30.0]},
    })  # fmt: skip

    @property
    def scale(self) -> float:
        return {"m": 1.0, "mm": 1e3, "in": 1 / 0.0254}[self.unit]

    def written(self, folder: Path) -> Path:
        """The files in a folder; the path of the case."""
        x, y, z = small.SIZE
        for name, start in (("a", 0.0), ("b", x)):
            self._body(folder / name, name, np.array([start, 0.0, 0.0]))
        ends = np.array([[x * i, 0.5 * y * j, 0.25 * z * k] for i in (0,) for j in range(3) for k in range(5)])
        rows = [[*(self.scale * p), 2e4 * (1 + 5 * q[2]), 1e4 * q[1] / y]
                for q, p in zip(ends, self.own("a", ends), strict=True)]  # fmt: skip
        text = "\n".join(",".join(map(repr, map(float, row))) for row in rows)
        (folder / "field.csv").write_text(f"x,y,z,p_real,p_imag\n{text}\n")
        contact = copy.deepcopy(CONTACT) | {"length_unit": self.unit}
        contact["roughness"]["R_Z"] *= self.scale
        (folder / "contact.toml").write_text(toml(contact))
        of_field = {"field": "field.csv", "face": "a:left", "length_unit": self.unit, "harmonic": 2, "amplitude": 10.0}
        loads = {"excitations": [{"row": "a:shaker", "amplitude": 200.0, "phase": 30.0}, of_field]}
        bodies = [{"name": n, "turn": self.place(n)[0], "shift": self.place(n)[1]} for n in "ab"]
        (folder / "case.toml").write_text(toml(self.case | loads | {"bodies": bodies}))
        return folder / "case.toml"

    def place(self, name: str) -> tuple[float, Array]:
        return self.places.get(name, (0.0, np.zeros(3)))

    def axes(self, name: str) -> Array:
        """(3, 3) axes of the drawing to those of a body's file."""
        return rotation(Y, -np.radians(self.place(name)[0])) @ self.Q

    def own(self, name: str, points: Array) -> Array:
        """Places (p, 3) in a body's own axes, m."""
        turn, shift = self.place(name)
        return (points @ self.Q.T - shift) @ rotation(Y, np.radians(turn))

    def _body(self, folder: Path, name: str, start: Array) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        mesh, s = small.beam((1, 1, 3)), small.SIZE
        cells = mesh.cells["tetra10"]
        if np.linalg.det(self.Q) < 0:
            cells = cells[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
        placed = Mesh(self.own(name, mesh.points + start), {"tetra10": cells}, mesh.faces, {}, mesh.node_id)
        sets = ("clamp", "tip", "contact_left", "contact_right")
        (folder / "mesh.inp").write_text("\n".join(mesh_lines(placed, self.scale, sets)) + "\n")

        def at(*point: float) -> Array:
            return self.scale * self.own(name, np.array([point]) + start)[0]

        R, middle = self.axes(name), at(s[0] / 2, s[1] / 2, s[2] / 2)
        up = R @ np.array([0.0, 0.0, 1.0])
        (folder / "body.toml").write_text(toml({
            "name": name, "length_unit": self.unit, "geometry": {"mesh": "mesh.inp"}, "reduction": "rubin",
            "material": {"density": 7850.0, "young": 2.1e11, "poisson": 0.3},
            "supports": [{"face": "clamp" if name == "a" else "tip"}],
            "interfaces": [{"name": n, "face": f"contact_{n}", "t2": up} for n in ("right", "left")],
            "excitations": [{"name": "shaker", "point": middle, "direction": R @ [1, 2, 0.5]}],
            "monitors": [{"name": "tip", "point": middle}],
            "gauges": [{"name": "root", "point": at(0.7 * s[0], 0.0, s[2] / 5), "direction": up + 0.3 * R[:, 1]}],
            "modes": {"count": 6, "solver": "superlu"}, "damping": {"ratio": 0.02},
            "output": {"gauss": False, "nodal_stress": False},
        }))  # fmt: skip
