"""Unsteady rolling: the row of point contacts, and the rubber wheel under it (Sextro, 6.10)."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from meshes import body, brick, graded, pipe
from refusals import refused, refused_command
from scipy.sparse.linalg import spsolve

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import ContactState, Mesh
from microslip.elasticity import isotropic
from microslip.fem.contact import Grip, Plane, coupled_points, make_pair
from microslip.fem.discretise import RULES, discretise, face_blocks, free_upper
from microslip.fem.loads import pressure
from microslip.fem.operators import stiffness
from microslip.linalg import eigen
from microslip.modal.equilibrium import equilibrium, make_model
from microslip.rolling.tyre import Brush, TyreAnswer, fitted, jump, parabola, reached, row
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

REDUCED = RULES["reduced"]
ROOT = Path(__file__).parents[1]
BRUSH = Brush(parabola(20), 0.012, 2e4, 1.0, 0.04)
PASS = BRUSH.length / BRUSH.speed


def test_a_small_jump_takes_the_time_of_the_closed_form() -> None:
    """All sticks: F/F_end = tau (2 - tau), tau = V t/(2a), so that 1 - 1/e is done at tau = 1 - exp(-1/2); second
    order in the elements."""
    off = []
    for n in (10, 20, 40):
        time, force = jump(replace(BRUSH, share=parabola(n)), 0.0, 1e-6, 40.0)
        tau = np.minimum(time / PASS, 1)
        np.testing.assert_allclose(force, BRUSH.stiffness * 1e-6 * BRUSH.length / 2 * tau * (2 - tau), rtol=1e-12)
        off.append(reached(time, force) / PASS - (1 - np.exp(-0.5)))
    assert off[1] == pytest.approx(0, abs=3e-4) and off[2] < 0.5 * off[0]


def test_up_jumps_are_faster_the_further_they_go_and_down_jumps_hardly_differ() -> None:
    """Fig. 6.10-5, whose points are not printed: a rigid wheel, and one whose mode gives way."""
    for brush in (BRUSH, replace(BRUSH, compliance=2e-5, frequency=1200.0)):
        targets = (0.01, 0.1, 0.2, 0.4)
        up, down = (
            np.array([fitted(*jump(brush, *ends, 40.0)) for ends in pairs])
            for pairs in ([(0.0, s) for s in targets], [(s, 0.0) for s in targets])
        )
        assert (np.diff(up) < 0).all() and up[-1] < 0.7 * up[0]
        assert np.ptp(down) < 0.2 * down.mean()


def test_compliance_of_the_wheel_adds_to_the_time() -> None:
    """A wheel so soft that the row is a damper, F = d (V s - w'), d = k a/V: exponential with c d."""
    soft = replace(BRUSH, compliance=4e-3)
    time, force = jump(soft, 0.0, 1e-6, 40.0, lengths=300.0)
    damper = BRUSH.stiffness * BRUSH.length / 2 / BRUSH.speed
    assert fitted(time, force) == pytest.approx(soft.compliance * damper, rel=2e-2)
    assert force[-1] == pytest.approx(BRUSH.stiffness * 1e-6 * BRUSH.length / 2, rel=1e-3)


def test_a_load_that_falls_lets_go_at_once_what_it_does_not_hold() -> None:
    """All slides: the force is mu F_N after one step; with slip that sticks it stays."""
    n = 300
    normal = np.concatenate([np.full(n, 40.0), np.full(n, 20.0)])
    slides, sticks = BRUSH.carried(np.full(2 * n, 1.0), normal), BRUSH.carried(np.full(2 * n, 1e-4), normal)
    assert slides[n - 1] == pytest.approx(40, rel=1e-12) and slides[n] == pytest.approx(20, rel=1e-12)
    assert sticks[n] == pytest.approx(sticks[n - 1], rel=0.02)


def test_the_patch_follows_its_load() -> None:
    """A line contact is alike under any load: length and pressure go with its root, the tangential force with it, where
    all sticks, where part slides, and where all does; 2.4 % off with 20 elements, 0.2 % with 80; there and back."""
    for slip, friction in ((1e-5, 1.0), (5e-2, 1.0), (0.2, 1.0), (0.9, 0.05)):
        for share in (0.5, 1.7):
            off = []
            for n in (20, 80):
                b = replace(BRUSH, share=parabola(n), friction=friction, under=40.0)
                load = 40.0 * np.concatenate([np.ones(4 * n), np.full(4 * n, share), np.ones(4 * n)])
                force = b.carried(np.full(12 * n, slip), load)
                off.append(abs(force[8 * n - 1] / force[4 * n - 1] / share - 1))
                assert force[-1] == pytest.approx(force[4 * n - 1], rel=1e-9)
            assert off[0] < 0.03 and off[1] < min(0.3 * off[0], 2.5e-3)
    b = replace(BRUSH, under=40.0)
    assert (b.carried([1e-2, 1e-2], [40.0, 0.0])[1], b.lengthened(10.0)) == (0.0, 0.5)


def test_the_picture_names_the_time_constants_of_the_table() -> None:
    """Of the same jumps, though it shows the first four passes of them alone."""
    pytest.importorskip("matplotlib")
    from microslip.pictures.plots import figure_of
    from microslip.pictures.tyre import tyre_picture

    patch = SimpleNamespace(
        x=np.zeros(1), pressure=np.ones(1), highest=1.0, middle=0.0, length=BRUSH.length, force=40.0
    )
    case = SimpleNamespace(jumps=SimpleNamespace(targets=[0.05, 0.3], shown=0.05))
    studied = TyreAnswer(case, patch, BRUSH, 0.0)  # type: ignore[arg-type]
    lines = figure_of(partial(tyre_picture, studied, title="t")).axes[2].lines
    for way, fit in (("up", lines[1]), ("down", lines[3])):
        assert fit.get_label() == f"exponential of {studied.constants[f'{way}_fitted_s'][0]:.3g} s"
        assert fit.get_xdata()[-1] == pytest.approx(4 * PASS, rel=0.06)
    told = {**studied.constants, "up_fitted_s": np.array([0.123, 0.5])}  # what the table says is what stands there
    vars(studied)["constants"] = told
    assert figure_of(partial(tyre_picture, studied, title="t")).axes[2].lines[1].get_label() == "exponential of 0.123 s"


def test_numbers_that_are_none_of_a_brush() -> None:
    for change in ({"speed": 0.0}, {"friction": -1.0}, {"share": np.ones(20)}):
        refused(next(iter(change)), replace, BRUSH, **change)


def test_the_row_of_a_patch_is_the_half_ellipse_of_its_pressure() -> None:
    """Force, centre and second moment are those of the pressure; (6.4-39) is that of Hertz."""
    x = np.linspace(-8e-3, 8e-3, 49)
    p = 2e5 * np.sqrt(np.maximum(1 - ((x - 5e-4) / 6e-3) ** 2, 0))
    points = np.array([[v, y, 0.0] for v in x for y in (-5e-3, 5e-3)])
    load = 0.01 * np.pi / 2 * 6e-3 * 2e5
    spread = np.diag([6e-3**2 / 4, 1e-2**2 / 12, 0.0])
    state = SimpleNamespace(points=points, areas=np.full(98, 0.01 * 0.016 / 98), pressure=np.repeat(p, 2),
                            normal_force=load, centre=np.array([5e-4, 0, 0]), spread=spread)  # fmt: skip
    found = row(state, np.array([1.0, 0.0, 0.0]), 20)  # type: ignore[arg-type]
    assert found.length == pytest.approx(12e-3, rel=1e-12) and found.highest == pytest.approx(2e5, rel=1e-12)
    at = np.linspace(0.95, -0.95, 20)
    assert found.share.sum() == pytest.approx(1, rel=1e-12)
    assert found.share @ at**2 == pytest.approx(0.25, rel=1e-2) and found.places == 36


# --- the wheel -----------------------------------------------------------------------------------------------------


def bore(n: int, poisson: float, degree: dict[str, int] | None) -> float:
    """Relative error of the radial displacement at the bore of a thick pipe under inner pressure, plane strain (Lame):
    n bricks along the radius of a quarter."""
    a, b, shear, load = 1.0, 2.0, 1.0, 1e-3
    mesh = pipe("hexahedron20", (n, 2 * n, 1), a, b, 0.5, np.pi / 2)
    d = discretise(mesh, degree)
    K = d.pattern.full(stiffness(d, isotropic(2 * (1 + poisson) * shear, poisson)))
    f = pressure(face_blocks(mesh, "x0"), mesh.n_points, load).ravel()
    x, y, _ = mesh.points.T
    fixed = np.column_stack([np.abs(x) < 1e-9, np.abs(y) < 1e-9, np.ones(len(x), bool)]).ravel()
    u = np.zeros(len(f))
    u[~fixed] = spsolve(K[~fixed][:, ~fixed].tocsc(), f[~fixed])
    at = np.abs(np.hypot(x, y) - a) < 1e-9
    radial = (u.reshape(-1, 3)[at, :2] * mesh.points[at, :2]).sum(axis=1).mean()
    exact = load * a**2 / (2 * shear * (b**2 - a**2)) * ((1 - 2 * poisson) * a + b**2 / a)
    return abs(radial / exact - 1)


def test_a_thick_pipe_that_keeps_its_volume_is_that_of_lame() -> None:
    """With eight points the error is the same at Poisson's ratios of 0.49 and 0.4999, and of fourth order; with all
    points it is 57 % at two elements and 0.4999."""
    found = {nu: [bore(n, nu, REDUCED) for n in (1, 2, 4)] for nu in (0.49, 0.4999)}
    for errors in found.values():
        assert -np.polyfit(np.log([1, 2, 4]), np.log(errors), 1)[0] > 3
    np.testing.assert_allclose(found[0.49], found[0.4999], rtol=0.02)
    assert bore(2, 0.4999, None) > 0.5 and found[0.4999][1] < 3e-4


def disc(half: float, fine: int, coarse: int) -> Mesh:
    """A quarter of a disc of radius 1 that stands on z = 0, but for a hole of 0.01 about its axle: `fine` boxes to 1.3
    times the half width of the contact, then `coarse` ones that grow, along the rim and into the depth."""
    s, grown = np.linspace(0, 1, fine + coarse + 1), graded(coarse, 60.0)(np.linspace(0, 1, coarse + 1))
    depth, angle = (
        np.concatenate([1.3 * half * np.arange(fine) / fine, 1.3 * half + (end - 1.3 * half) * grown])
        for end in (0.99, np.pi / 2)
    )

    def to(p: np.ndarray) -> np.ndarray:
        r, t = 1 - np.interp(1 - p[:, 0], s, depth), np.interp(p[:, 1], s, angle)
        return np.column_stack([r * np.sin(t), -p[:, 2], 1 - r * np.cos(t)])

    return brick("hexahedron20", (fine + coarse, fine + coarse, 1), (1, 1, 0.2 * half), to=to)


def standing(
    mesh: Mesh, held: str, young: float, poisson: float, degree: dict[str, int] | None, approach: float
) -> Grip:
    """Half of a wheel in plane strain, whose outside `x1` is lowered on z = 0; held: faces and their directions."""
    pair = make_pair(mesh, "ground", "x1", Plane(np.zeros(3), np.array([0, 0, 1.0])), young, interference=approach)
    d = discretise(mesh, degree, coupled=[coupled_points(pair)])
    sides = [(face, "xyz".index(c)) for face, cs in (s.split(":") for s in held.split()) for c in cs]
    fixed = np.unique(np.concatenate([3 * mesh.face_points(face) + k for face, k in sides]))
    rubber = body({"density": 1.0, "young": young, "poisson": poisson, "unusual": True}).material.material()
    free, none = free_upper(d.pattern, fixed), np.zeros((mesh.n_points, 3))
    model = make_model(d, rubber, free, fixed, np.array([0, 1.0, 0]), np.zeros(3), None, 293.15, none, True)
    solver = eigen.new_solver()
    state = equilibrium(replace(model, contacts=(pair,)), 0.0, "nonlinear", solver)
    solver.close()
    return state.contacts[0]


def lowered(half: float, fine: int, coarse: int, poisson: float, degree: dict[str, int] | None) -> float:
    """Relative error of the approach of a disc's axle to the ground, plane strain, for the force that it makes.

    Johnson, Contact Mechanics (1985), 5.6, a disc between two plates: d = P/(pi E*) (2 ln(4 R/a) - 1), a^2 = 4 P R/(pi
    E*); E* = 1 here. It is lowered so that a is about `half`.
    """
    approach = half**2 / 4 * (2 * np.log(4 / half) - 1)
    g = standing(disc(half, fine, coarse), "y0:x y1:z z0:y z1:y", 1 - poisson**2, poisson, degree, approach)
    force = 2 * g.force[:, 2].sum() / (0.2 * half)
    width = np.sqrt(4 * force / np.pi)
    return float(approach / (force / np.pi * (2 * np.log(4 / width) - 1)) - 1)


@pytest.mark.parametrize(("poisson", "degree"), [(0.3, None), (0.499, REDUCED)])
def test_a_disc_is_lowered_as_the_closed_form_says(poisson: float, degree: dict[str, int] | None) -> None:
    """A contact a fiftieth of the radius wide: 0.1 % measured."""
    assert abs(lowered(0.01, 4, 6, poisson, degree)) < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(("poisson", "degree"), [(0.3, None), (0.499, REDUCED), (0.4999, REDUCED)])
def test_the_approach_of_a_disc_converges(poisson: float, degree: dict[str, int] | None) -> None:
    """Of third order in the size (2.9 to 3.6). What is left, 0.25 %, is of the finite strains: twice as wide a contact
    has twice as much, and without them 0.1 % is left. Elements that lock would show: with all points the coarsest mesh
    is off by 14 % at 0.499, with eight by 4 %."""
    finest = lowered(0.01, 4, 10, poisson, degree)
    off = [abs(lowered(0.01, 2, n, poisson, degree) - finest) for n in (3, 5)]
    assert np.log(off[0] / off[1]) / np.log(5 / 3) > 2.7 and off[0] < 0.05
    assert abs(finest) < 4e-3
    assert abs(2 * finest - lowered(0.02, 4, 10, poisson, degree)) < 2e-3


@pytest.mark.slow
def test_the_length_of_a_patch_converges() -> None:
    """4 times the root of the second moment of the pressure, plane strain: where edges lie in their elements matters
    little, 1 % with five elements along it, 0.1 % with thirteen."""
    found = []
    for size in (2.5e-3, 1.75e-3, 1e-3, 0.75e-3):
        n = (int(np.ceil(0.0125 / size)), int(np.ceil(0.035 / size)), 1)
        whole = pipe("hexahedron20", n, 0.025, 0.05, size, 0.7)
        flat = whole.points
        points = np.column_stack([flat[:, 1], -flat[:, 2], 0.05 - flat[:, 0]])  # stands on the cut y0
        wheel = Mesh(points, whole.cells, whole.faces, {}, whole.node_id)
        g = standing(wheel, "x0:xyz y0:x z0:y z1:y", 3e6, 0.499, REDUCED, 1e-3)
        x = np.concatenate([np.einsum("pk,pk->p", p.N, points[p.slave][..., 0]) for p in g.cut.points])
        weight = g.point_weight * g.point_pressure
        found.append(4 * np.sqrt(weight @ x**2 / weight.sum()))
    off = np.abs(np.array(found[:-1]) / found[-1] - 1)
    assert off[0] < 0.015 and off[1] < 0.004 and off[2] < 0.0015


def pressed(tmp_path: Path, *changes: str) -> ContactState:
    """How a coarse wheel is pressed when it is lowered by 0.5 mm."""
    given = ("closures=[{name='ground', face='tread', against='ground', point=[0.0, 0.0, -50.0], "
             "normal=[0.0, 0.0, 1.0], interference=0.5}]", "modes.count=1", "output.gauss=false",
             "output.nodal_stress=false", "output.shapes=false")  # fmt: skip
    basis = read_basis(modes_stage(open_job(ROOT / "geometry" / "tyre", [*given, *changes], tmp_path))[0])
    return basis.groups[0, 0].contacts["ground"]


@pytest.mark.slow
def test_rubber_that_keeps_its_volume_does_not_lock(tmp_path: Path) -> None:
    """At a Poisson's ratio of 0.4999 elements of 7 mm differ from those of 5 mm by less than a tenth of what all points
    add to them; that falls as the mesh is refined."""
    forces = {
        (rule, size): pressed(
            tmp_path / f"{rule}{size}", f"mesh.size={size}", "material.poisson=0.4999", "material.young=2.9998e6",
            f'mesh.integration="{rule}"',
        ).normal_force
        for rule, size in (("reduced", 7.0), ("reduced", 5.0), ("full", 7.0), ("full", 5.0))
    }  # fmt: skip
    best = forces["reduced", 5.0]
    excess = [forces["full", size] - best for size in (7.0, 5.0)]
    assert abs(forces["reduced", 7.0] - best) < 0.1 * excess[0]
    assert excess[1] < 0.7 * excess[0]
    assert 0.6 < np.log(excess[0] / excess[1]) / np.log(7 / 5) < 4


def test_rubber_of_no_compressibility_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Poisson's ratio 0.5 has no stiffness matrix; bricks of another kind have no reduced rule."""
    tyre = str(ROOT / "geometry" / "tyre")
    refused_command(["modes", tyre, "--set", "material.poisson=0.5", "-q"], capsys, "material.poisson")


@pytest.mark.slow
def test_a_tyre_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its table of time constants; a contact that is none."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "geometry").symlink_to(ROOT / "geometry")
    case = str(ROOT / "pipeline" / "cases" / "slip-jump.toml")
    assert main(["roll", case, "--no-pictures", "-q"]) == 0
    rows = list(csv.DictReader((tmp_path / "build" / "slip-jump" / "constants.csv").open()))
    up = [float(r["up_fitted_s"]) for r in rows]
    down = [float(r["down_fitted_s"]) for r in rows]
    assert np.diff(up).max() < 1e-3 * up[0] and up[-1] < 0.4 * up[0] and max(down) < 1.1 * min(down)
    assert main(["roll", case, "--set", 'tyre.contact="road"', "-q"]) == 2
