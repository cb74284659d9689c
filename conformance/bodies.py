"""The sample bodies: twisted vanes and a ring's sector of 20-node bricks, drawn without gmsh, and masses on springs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from microslip.data import Array, Matrices, Mesh, ModalBasis
from microslip.mesh import boundary_facets
from microslip.modal.compute import modal_basis
from microslip.modal.foreign import foreign_basis
from microslip.settings.body import BodySettings
from microslip.system import Body, Damper, Force, Monitor, Spring, System, system_basis

ROOT = Path(__file__).resolve().parents[1]
_CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
_MIDDLES = (
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2), (0, 0, 1), (2, 0, 1),
    (2, 2, 1), (0, 2, 1),
)  # fmt: skip
STEEL = {"name": "steel", "density": 7850.0, "young": 2.1e11, "poisson": 0.3}


def bricks(divisions: tuple[int, int, int], place: Callable[[Array], Array]) -> tuple[Mesh, Array]:
    """20-node bricks over the unit cube, moved by `place`; the mesh, and the points' places in the cube."""
    number: dict[tuple[int, ...], int] = {}
    cells = []
    for k, j, i in product(*(range(n) for n in divisions[::-1])):
        nodes = [(2 * i + a, 2 * j + b, 2 * k + c) for a, b, c in (*_CORNERS, *_MIDDLES)]
        cells.append([number.setdefault(node, len(number)) for node in nodes])
    unit = np.array(list(number), dtype=float) / (2 * np.array(divisions))
    # places rounded to a picometre: the last digits of sin and cos differ between machines
    points = np.round(place(unit), 12)
    return Mesh(points, {"hexahedron20": np.array(cells)}, {}, {}, np.arange(1, len(points) + 1)), unit


def faces(mesh: Mesh, chosen: dict[str, Array]) -> Mesh:
    """The mesh with faces of those names: outer facets whose points are all among the chosen ones (n,) bool."""
    outer = boundary_facets(mesh)
    return replace(mesh, faces={n: {t: f[at[f].all(axis=1)] for t, f in outer.items()} for n, at in chosen.items()})


def vane(divisions: tuple[int, int, int], patch: float) -> Mesh:
    """8 x 40 x 160 mm, twisted by 20 degrees; clamped at z = 0, patches on both sides of the uppermost `patch`."""

    def place(unit: Array) -> Array:
        x, y, z = ((unit - [0.5, 0.5, 0.0]) * [0.008, 0.04, 0.16]).T
        angle = np.deg2rad(20) * (1 - unit[:, 2])
        return np.column_stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])

    mesh, unit = bricks(divisions, place)
    top = unit[:, 2] > 1 - patch - 1e-9
    return faces(
        mesh,
        {
            "clamp": unit[:, 2] == 0,
            "tip": unit[:, 2] == 1,
            "side": unit[:, 0] == 1,
            "contact_right": (unit[:, 0] == 1) & top,
            "contact_left": (unit[:, 0] == 0) & top,
        },
    )


def vane_settings(name: str, **changes: object) -> BodySettings:
    """Two shrouds, a magnet, gas, a probe and a strain gauge."""
    table: dict = {
        "name": name,
        "length_unit": "m",
        "geometry": {"mesh": "vane.inp"},
        "material": STEEL,
        "supports": [{"face": "clamp"}],
        "interfaces": [
            {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1},
            {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1},
        ],
        "excitations": [
            {"name": "magnet", "point": [0.0, 0.0, 0.096], "direction": [1.0, 0.2, 0.0]},
            {"name": "gas", "face": "side", "pressure": True},
        ],
        "monitors": [{"name": "probe", "point": [0.0, 0.01, 0.155]}],
        "gauges": [{"name": "root", "point": [0.0, 0.0, 0.02], "direction": [0.0, 0.0, 1.0]}],
        "modes": {"count": 6, "solver": "superlu"},
        "damping": {"ratio": 0.002},
        "output": {"gauss": False},
    }
    return BodySettings.model_validate(table | changes)


def sector_mesh(sectors: int) -> Mesh:
    """A swept sector of a disc about the y axis, bore 50 mm, rim 120 mm, 12 mm wide; no other symmetry is left."""
    angle = 2 * np.pi / sectors

    def place(unit: Array) -> Array:
        r, turn = 0.05 + 0.07 * unit[:, 0], angle * (unit[:, 1] - 0.5) + 0.21 * unit[:, 0]
        y = 0.012 * unit[:, 2] * (1 + 0.4 * np.sin(2 * np.pi * unit[:, 1])) + 0.014 * unit[:, 0]
        return np.column_stack([r * np.sin(turn), y, r * np.cos(turn)])

    mesh, unit = bricks((2, 2, 1), place)
    ends = {"bore": (0, 0), "rim": (0, 1), "cyclic_left": (1, 0), "cyclic_right": (1, 1)}
    return faces(mesh, {name: unit[:, axis] == end for name, (axis, end) in ends.items()})


def sector_settings(sectors: int) -> BodySettings:
    """Held at the bore, a patch on the rim, a force along the axis and a probe there."""
    tip = [0.12 * float(np.sin(0.21)), 0.014, 0.12 * float(np.cos(0.21))]
    return BodySettings.model_validate(
        {
            "name": "sector",
            "length_unit": "m",
            "geometry": {"mesh": "sector.inp"},
            "material": STEEL,
            "supports": [{"face": "bore"}],
            "cyclic": {"sectors": sectors},
            "interfaces": [{"name": "rim", "face": "rim", "t2": [0.0, 1.0, 0.0]}],
            "excitations": [{"name": "gas", "point": tip, "direction": [0.0, 1.0, 0.3]}],
            "monitors": [{"name": "probe", "point": tip}],
            "modes": {"count": 5, "solver": "superlu"},
            "damping": {"ratio": 0.002},
            "output": {"gauss": False, "nodal_stress": False},
        }
    )


def _told(settings: BodySettings) -> dict[str, str]:
    return {"settings_sha256": "", "note": "conformance sample", "name": settings.name}


def two_masses() -> ModalBasis:
    """The least a file can be: two points that slide along x, a force, a probe, no interface."""
    return System(
        "two-masses",
        components=[Body("m1", 1.0, (1.0, 0.0, 0.0), free="x"), Body("m2", 2.0, (2.0, 0.0, 0.0), free="x")],
        links=[Spring("ground", "m1", 1e4), Spring("m1", "m2", 2e4), Damper("m1", "m2", 3.0)],
        forces=[Force("shaker", "m1", direction=(1.0, 0.0, 0.0))],
        monitors=[Monitor("end", "m2")],
        ratio=0.005,
    ).basis()


def three_masses() -> ModalBasis:
    """Points alone, three modes, a damping matrix that couples them."""
    return system_basis(ROOT / "pipeline/microslip/templates/three-masses/system.toml")


def sliding_masses() -> ModalBasis:
    """Three masses whose stiffness is not symmetric, as that of sliding contacts: N_r and G_r beside the modes."""
    K = 1e4 * np.array([[3.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
    N = 2e3 * np.array([[0.1, 1.0, 0.0], [-0.8, 0.0, 0.5], [0.0, -0.5, 0.0]])  # neither symmetric nor skew
    G = np.array([[0.0, 3.0, 0.0], [-3.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    mesh = Mesh(np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.3, 0.0, 0.0]]), {}, {}, {}, np.arange(1, 4))
    M, C = np.diag([1.0, 2.0, 1.5]), 2e-5 * K
    M_, C_, K_, G_, N_ = (csr_matrix(A) for A in (M, C, K, G, N))
    body = Matrices(K_, M_, C_, G_, mesh, np.arange(3), np.zeros(3, dtype=np.int64), True, circulatory=N_)
    settings = BodySettings.model_validate(
        {
            "name": "sliding-masses",
            "length_unit": "m",
            "geometry": {"matrices": {"stiffness": "K.mtx", "mass": "M.mtx", "nodes": "nodes.csv", "grounded": True}},
            "excitations": [{"name": "shaker", "node": 1, "direction": [1.0, 0.0, 0.0]}],
            "monitors": [{"name": "end", "node": 3, "directions": "x"}],
            "modes": {"count": 3, "solver": "superlu"},
        }
    )
    return foreign_basis(body, settings, provenance=_told(settings))[0]


def vane_eigenmodes() -> ModalBasis:
    """Eigenmodes with stress at the nodes."""
    settings = vane_settings("vane-eigenmodes")
    return modal_basis(vane((1, 2, 5), 0.2), settings, provenance=_told(settings))


def vane_craig_bampton() -> ModalBasis:
    """Physical interface coordinates first, fixed-interface modes behind."""
    settings = vane_settings(
        "vane-craig-bampton", reduction="craig-bampton", output={"gauss": False, "nodal_stress": False}
    )
    return modal_basis(vane((1, 2, 5), 0.2), settings, provenance=_told(settings))


def sector_cyclic() -> ModalBasis:
    """Nodal diameters 0 to 3 of six sectors, 1 and 2 complex."""
    settings = sector_settings(6)
    return modal_basis(sector_mesh(6), settings, provenance=_told(settings))


def vane_full() -> ModalBasis:
    """Everything a file can hold of a lone body: speeds, gyroscopic modes, a closure, stresses."""
    interfaces = [i.model_dump() | {"coordinates": "characteristic", "count": 2} for i in vane_settings("x").interfaces]
    settings = vane_settings(
        "vane-full",
        interfaces=interfaces,
        rotation={"speeds_rpm": [0.0, 6000.0], "point": [0.0, 0.0, -0.3], "axis": [0.0, 1.0, 0.0]},
        closures=[{"name": "stop", "face": "tip", "against": "ground", "interference": 1e-6, "modes": "closed"}],
        output={"stiffening": True},
        modes={"count": 8, "solver": "superlu"},
        reduction="rubin",
    )
    return modal_basis(vane((2, 2, 6), 0.25), settings, provenance=_told(settings))


def vane_range() -> ModalBasis:
    """One basis for every speed of a range."""
    settings = vane_settings(
        "vane-range",
        rotation={"range_rpm": [0.0, 9000.0], "point": [0.0, 0.0, -0.3], "range_points": 5},
        output={"gauss": False, "nodal_stress": False},
    )
    return modal_basis(vane((1, 2, 5), 0.2), settings, provenance=_told(settings))


SAMPLES: dict[str, Callable[[], ModalBasis]] = {
    "two-masses": two_masses,
    "three-masses": three_masses,
    "sliding-masses": sliding_masses,
    "vane-eigenmodes": vane_eigenmodes,
    "vane-craig-bampton": vane_craig_bampton,
    "sector-cyclic": sector_cyclic,
    "vane-full": vane_full,
    "vane-range": vane_range,
}
LARGE = ("vane-full", "vane-range")
"""Not kept in the repository: `make.py` makes them."""
