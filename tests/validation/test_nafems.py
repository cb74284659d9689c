"""NAFEMS benchmarks with solids: what the targets are, what a converged solid gives, and why they differ.

LE1, LE10, LE11, FV16, FV32, FV52: The Standard NAFEMS Benchmarks, TNSB Rev. 3 (1990); Abbassian, Dawswell, Knowles,
Selected Benchmarks for Natural Frequency Analysis, NAFEMS R0015 (1987). Test 21: Selected Benchmarks for Forced
Vibration, NAFEMS R0016 (1993). Rotating discs: Timoshenko, Goodier, Theory of Elasticity.

Every mesh is refined twice. The change of the last refinement is asserted, and so is the converged value where it
is known; what is then left to the target is the target's: a theory of plates, a coarse mesh, a rounded stress.
Nothing is tuned: the tolerances against targets are the differences of the theories, given in each test.
"""

from __future__ import annotations

import numpy as np
import pytest
from meshes import STEEL, body, brick, graded, nearest, with_sets
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import brentq

from microslip.modal.compute import modal_basis

CELLS = ("hexahedron20", "hexahedron27", "tetra10")
CELLS_SLOW = ("hexahedron20", *(pytest.param(c, marks=pytest.mark.slow) for c in CELLS[1:]))
BRICKS_SLOW = ("hexahedron20", pytest.param("tetra10", marks=pytest.mark.slow))
METAL = {"density": 8000.0, "young": 2e11, "poisson": 0.3}  # of the FV tests; the LE tests are of STEEL
QUARTER = [{"face": "y0", "directions": "y"}, {"face": "y1", "directions": "x"}]  # symmetry at y = 0 and x = 0


def static(mesh, temperature=None, **what):
    """Displacement (n, 3) and smoothed nodal stress (n, 6), Pa: one linear solution, as the benchmarks are."""
    settings = body(**{
        "material": STEEL, "modes": {"count": 1, "certify": False}, "rotation": {"prestress": "linear"},
        "output": {"gauss": False, "nodal_stress": True}, **what,
    })  # fmt: skip
    group = modal_basis(mesh, settings, temperature).groups[0, 0]
    return group.u_static, group.stresses["nodes"].static_stress


def modes(mesh, count, **what):
    """Frequencies, Hz, and the share of z in each mode."""
    group = modal_basis(mesh, body(**{"material": METAL, "modes": {"count": count}, **what})).groups[0, 0]
    share = (group.phi**2).sum(axis=0)
    return group.omega / (2 * np.pi), share[2] / share.sum(axis=0)


def assert_converged(values, change):
    """The last of three refinements changes every value by less than `change` (relative)."""
    last, before = np.asarray(values[-1]), np.asarray(values[-2])
    np.testing.assert_allclose(last, before, rtol=change)
    return last


# ---------------------------------------------------------------- LE1, LE10: between two ellipses


def between_ellipses(cell_type, n, height, growth):
    """A quarter of a plate between the ellipses x/2, y/1 and x/3.25, y/2.75 m; x0 inside, x1 outside.

    Its cells grow away from D = (2, 0) along both coordinates, and from both faces towards the middle plane.
    """
    outwards, around = graded(n[0], growth), graded(n[1], growth)
    upwards = graded(n[2], 4, both=True) if n[2] > 1 else graded(1, 1)

    def to(p):
        s, t = outwards(p[:, :1]), around(p[:, 1]) * np.pi / 2
        inside, outside = (np.column_stack([a * np.cos(t), b * np.sin(t)]) for a, b in ((2, 1), (3.25, 2.75)))
        return np.column_stack([inside + (outside - inside) * s, height * upwards(p[:, 2])])

    return brick(cell_type, n, to=to)


@pytest.mark.parametrize("cell_type", CELLS_SLOW)
def test_le1_elliptic_membrane(cell_type):
    """10 MPa pull on the outer edge of a membrane: target sigma_yy(D) = 92.7 MPa.

    Solids: a thin slice (0.02 m) on its plane of symmetry, in plane stress. Bricks: 92.63 MPa, still rising
    towards the target; tetrahedra 92.56, by extrapolation to the surface. Allowed 0.3 %.
    """
    found = []
    for n in (4, 8, 16):
        mesh = between_ellipses(cell_type, (n, n, 1), 0.01, growth=8)
        supports = [*QUARTER, {"face": "z0", "directions": "z"}]
        _, stress = static(mesh, supports=supports, loads=[{"kind": "pressure", "face": "x1", "value": -1e7}])
        found.append(stress[nearest(mesh, (2, 0, 0)), 1] / 1e6)
    assert assert_converged(found, 5e-3) == pytest.approx(92.7, rel=3e-3)


@pytest.mark.parametrize("cell_type", CELLS_SLOW)
def test_le10_thick_plate(cell_type):
    """1 MPa on the upper face of a plate 0.6 m thick: target sigma_yy(D) = -5.38 MPa on that face.

    The outer face is held in x and y, its middle line in z. Converged: -5.40 MPa (54,000 degrees of freedom, two
    gradings), 0.4 % above the target. Here bricks give -5.402, tetrahedra -5.374: 0.7 % allowed to -5.40, so 1.1 %
    to the target. The first mesh is a sketch of twelve boxes, 3 % (bricks) and 15 % (tetrahedra) off.
    """
    found = []
    for k in (1, 2, 4):
        mesh = between_ellipses(cell_type, (2 * k, 3 * k, 2 * k), 0.6, growth=8)
        outer = mesh.face_points("x1")
        mesh = with_sets(mesh, middle=outer[np.isclose(mesh.points[outer, 2], 0.3)])
        supports = [*QUARTER, {"face": "x1", "directions": "xy"}, {"face": "middle", "directions": "z"}]
        _, stress = static(mesh, supports=supports, loads=[{"kind": "pressure", "face": "z1", "value": 1e6}])
        found.append(stress[nearest(mesh, (2, 0, 0.6)), 1] / 1e6)
    last = assert_converged(found, 8e-3)
    assert last == pytest.approx(-5.40, rel=7e-3)
    assert last == pytest.approx(-5.38, rel=1.1e-2)


# ---------------------------------------------------------------- LE11


def cylinder_taper_sphere(cell_type, n):
    """A quarter of the body of LE11 about z; boxes n along radius, circumference and height (a multiple of four).

    Inside a sphere of radius 1 up to 45 degrees, then a cylinder; outside a sphere of radius 1.4 up to 30 degrees,
    a cone to (1, 1.39) and a cylinder to the top at 1.79 m. z0: bottom with A = (1, 0, 0). Cells grow away from A.
    """
    outwards, around, up = graded(n[0], 8), graded(n[1], 3), graded(n[2] // 4, 8)
    half = np.sqrt(0.5)

    def to(p):
        t = 4 * p[:, 2]
        t = np.where(t < 1, up(np.minimum(t, 1)), t)
        a, b = np.radians(22.5 * np.minimum(t, 2)), np.radians(30 * np.minimum(t, 1))
        inside = np.cos(a), np.where(t < 2, np.sin(a), np.interp(t, [2, 4], [half, 1.79]))
        outside = (
            np.where(t < 1, 1.4 * np.cos(b), np.interp(t, [1, 3, 4], [1.4 * np.cos(np.pi / 6), 1, 1])),
            np.where(t < 1, 1.4 * np.sin(b), np.interp(t, [1, 3, 4], [0.7, 1.39, 1.79])),
        )
        s, angle = outwards(p[:, 0]), around(p[:, 1]) * np.pi / 2
        r, z = (i + (o - i) * s for i, o in zip(inside, outside, strict=True))
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])

    return brick(cell_type, n, to=to)


@pytest.mark.slow
@pytest.mark.parametrize("cell_type", CELLS_SLOW)
def test_le11_solid_cylinder_taper_sphere(cell_type):
    """Heated by sqrt(x^2 + y^2) + z degrees between flat ends: target sigma_zz(A) = -105 MPa.

    Converged: -105.4 MPa (56,000 degrees of freedom, two gradings), 0.4 % above the rounded target. Here bricks give
    -105.1 and -105.2, tetrahedra -104.8: 0.7 % allowed to -105.4, so 0.5 % to the target from these meshes.
    """
    found = []
    for k in (1, 2, 3):
        mesh = cylinder_taper_sphere(cell_type, (2 * k, 2 * k, 8 * k))
        ends = [{"face": f, "directions": "z"} for f in ("z0", "z1")]
        heat = 293.15 + np.linalg.norm(mesh.points[:, :2], axis=1) + mesh.points[:, 2]
        _, stress = static(mesh, heat, material={**STEEL, "expansion": 2.3e-4}, supports=QUARTER + ends)
        found.append(stress[nearest(mesh, (1, 0, 0)), 2] / 1e6)
    last = assert_converged(found, 6e-3)
    assert last == pytest.approx(-105.4, rel=7e-3)
    assert last == pytest.approx(-105, rel=5e-3)


# ---------------------------------------------------------------- FV16: cantilevered thin square plate

FV16 = np.array([0.421, 1.029, 2.582, 3.306, 3.753, 6.555])


def kirchhoff_cantilever(terms=20, side=10.0, thickness=0.05):
    """Frequencies, Hz, of the thin square plate by Ritz: products of Legendre polynomials, x^2 at the clamp."""
    nodes, weights = legendre.leggauss(3 * terms)
    x, w = (nodes + 1) / 2, weights / 2
    P = [legendre.Legendre.basis(i, domain=[0, 1]) for i in range(terms)]
    Y = np.array([[p.deriv(d)(x) if d else p(x) for d in range(3)] for p in P])  # (terms, derivative, point)
    X = np.stack([x**2 * Y[:, 0], 2 * x * Y[:, 0] + x**2 * Y[:, 1], 2 * Y[:, 0] + 4 * x * Y[:, 1] + x**2 * Y[:, 2]], 1)

    def term(a, b, c, d):
        return np.kron((X[:, a] * w) @ X[:, b].T, (Y[:, c] * w) @ Y[:, d].T)

    nu = METAL["poisson"]
    poisson, twist = term(2, 0, 0, 2) + term(0, 2, 2, 0), term(1, 1, 1, 1)
    K = term(2, 2, 0, 0) + term(0, 0, 2, 2) + nu * poisson + 2 * (1 - nu) * twist
    values = eigh(K, term(0, 0, 0, 0), eigvals_only=True, subset_by_index=(0, 5))
    wave = np.sqrt(METAL["young"] * thickness**2 / (12 * METAL["density"] * (1 - nu**2)))
    return np.sqrt(values) * wave / (2 * np.pi * side**2)


def test_fv16_targets_are_upper_bounds():
    """The targets are Ritz solutions of the fifties: up to 1 % above the converged theory of thin plates."""
    exact = kirchhoff_cantilever()
    np.testing.assert_allclose(kirchhoff_cantilever(16), exact, rtol=5e-5)
    # 3.4710, 8.5063, ...: frequencies over sqrt(D / (rho h a^4)), to the digits of the next set of terms
    np.testing.assert_allclose(exact / 0.1204069, [3.4710, 8.5063, 21.284, 27.199, 30.955, 54.185], rtol=5e-5)
    high = FV16 / exact - 1
    assert (high > 4e-3).all() and (high < 1e-2).all()


def thin_cantilever(cell_type, n, growth):
    """Frequencies, Hz, of the plate of FV16 by n x n x 1 boxes, smaller towards its edges."""
    edges = graded(n, growth, both=True)
    to = lambda p: np.column_stack([10 * edges(p[:, 0]), 10 * edges(p[:, 1]), p[:, 2]])  # noqa: E731
    return modes(brick(cell_type, (n, n, 1), (1, 1, 0.05), to=to), 6, supports=[{"face": "x0"}])[0][:6]


@pytest.mark.slow
def test_fv16_cantilevered_thin_plate():
    """10 x 10 x 0.05 m, clamped along x = 0: targets 0.421, 1.029, 2.582, 3.306, 3.753, 6.555 Hz.

    Solids: 0.4184, 1.0239, 2.5655, 3.2742, 3.7266, 6.5190 Hz, within 0.15 % of thin-plate theory (allowed 0.25 %),
    which errs by a part of thickness over side, 0.5 %, where free edges twist. So they lie 0.5 to 1 % below the
    targets, which are upper bounds. The last refinement lowers them by 0.15 to 0.3 %.
    """
    found = [thin_cantilever("hexahedron20", n, 4) for n in (12, 24, 48)]
    assert (np.diff(found, axis=0) < 0).all()  # displacement elements come from above
    last = assert_converged(found, 4e-3)
    np.testing.assert_allclose(last, kirchhoff_cantilever(), rtol=2.5e-3)
    below = 1 - last / FV16
    assert (below > 3e-3).all() and (below < 1.1e-2).all()


@pytest.mark.slow
def test_fv16_by_flat_tetrahedra():
    """Tetrahedra of 0.3 x 0.3 x 0.05 m are stiff in bending: from above by 1 % in mode 6; by 22 % at 1.2 m."""
    above = [thin_cantilever("tetra10", n, 1) / kirchhoff_cantilever() - 1 for n in (8, 16, 32)]
    assert (above[-1] > 0).all() and (above[-1] < 1.2e-2).all()
    assert (np.diff(above, axis=0) < 0).all()
    assert (above[-1] < 0.45 * above[-2]).all()  # order above 1, with the edges; 2 to 3 inside


# ---------------------------------------------------------------- FV32: cantilevered tapered membrane

FV32 = np.array([44.623, 130.03, 162.70, 246.05, 379.90, 391.44])


@pytest.mark.parametrize("cell_type", CELLS_SLOW)
def test_fv32_tapered_membrane(cell_type):
    """10 m long, 5 m wide at the root and 1 m at the tip, held in its plane at the root, thickness 0.05 m.

    Half its thickness on the plane of symmetry is in plane stress. A mesh of 16 x 8 bricks of 20 nodes gives the
    targets to their last digit, so that they are such a mesh's; 32 x 16 is up to 0.05 % lower (44.619, 130.02, 162.69,
    246.00, 379.73, 391.41), and hardly moves any more: the root's corners are singular.
    """
    found = []
    for n in (4, 8, 16):
        to = lambda p: np.column_stack([p[:, 0], p[:, 1] * (5 - 0.4 * p[:, 0]), p[:, 2]])  # noqa: E731
        mesh = brick(cell_type, (2 * n, n, 1), (10, 1, 0.025), (0, -0.5, 0), to)
        supports = [{"face": "x0", "directions": "xy"}, {"face": "z0", "directions": "z"}]
        found.append(modes(mesh, 6, supports=supports)[0][:6])
    assert (np.diff(found, axis=0) < 0).all()
    last = assert_converged(found, 1e-3)
    np.testing.assert_allclose(last, [44.619, 130.016, 162.692, 245.997, 379.734, 391.412], rtol=5e-5)
    np.testing.assert_allclose(last, FV32, rtol=6e-4)
    if cell_type == "hexahedron20":
        np.testing.assert_allclose(found[1], FV32, rtol=4e-5)  # half of the last digit of 130.03


# ---------------------------------------------------------------- FV52: simply supported solid square plate

FV52 = np.array([45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19])
RIM = ("x0", "x1", "y0", "y1")


def solid_plate(cell_type, n, count=14, **what):
    """Frequencies, Hz, and shares of z of the plate 10 x 10 x 1 m by n boxes."""
    mesh = brick(cell_type, n, (10, 10, 1))
    rim = np.unique(np.concatenate([mesh.face_points(f) for f in RIM]))
    mesh = with_sets(mesh, edges=rim[mesh.points[rim, 2] == 0])
    return modes(mesh, count, **what)


def bending_and_in_plane(cell_type, n, supports):
    """Frequencies, Hz, of the modes that move along z and of those in the plane; three of these are rigid."""
    frequency, share = solid_plate(cell_type, n, supports=supports, free=True)
    assert (frequency[:3] == 0).all() and (frequency[3:] > 1).all()  # nothing holds the plate in its plane
    elastic = frequency > 0
    return frequency[elastic & (share > 0.5)], frequency[elastic & (share < 0.5)]


EDGES = [{"face": "edges", "directions": "z"}]


def test_fv52_on_the_published_mesh():
    """uz = 0 along the four lower edges, 4 x 4 x 1 bricks of 20 nodes: another program's print, digit by digit.

    OptiStruct's verification manual (OS-V: 0455) gives, over the targets, 0.9760, 1.0101, 1.0072, 1.0017, 1.0022.
    """
    bending, in_plane = bending_and_in_plane("hexahedron20", (4, 4, 1), EDGES)
    found = np.concatenate([bending[:4], in_plane[:3]]) / FV52
    np.testing.assert_allclose(found, [0.9760, 1.0101, 1.0101, 1.0072, 1.0017, 1.0022, 1.0022], atol=6e-5)


@pytest.mark.slow
@pytest.mark.parametrize("cell_type", CELLS[::2])
def test_fv52_solid_plate_on_its_lower_edges(cell_type):
    """Targets 45.897, 109.44, 109.44, 167.89 Hz (bending), 193.59, 206.19, 206.19 Hz (in the plane).

    In the plane solids converge, to 193.592 and 206.07 Hz: 0.06 % from the targets. In bending they do not: a line
    support of a solid gives way as the logarithm of the cell size. Bricks of 20 nodes: 44.796, 43.716, 43.241, and
    43.02, 42.89 Hz on meshes of 24 and 32 boxes a side; 110.5, 105.5, 103.7 Hz; 169.1, 158.3, 154.5 Hz. The targets
    are a thick plate's with hard supports (`test_fv52_between_hard_supports`). Other programs print 44.092, 106.66,
    156.23 Hz for linear bricks of 8 x 8 x 3. So bending is only bounded: below its value on the mesh before, and
    2 to 9 % below the target on 16 x 16 x 4.
    """
    found = [bending_and_in_plane(cell_type, n, EDGES) for n in ((4, 4, 1), (8, 8, 2), (16, 16, 4))]
    in_plane = assert_converged([p[:3] for _, p in found], 6e-4)
    np.testing.assert_allclose(in_plane, [193.592, 206.068, 206.068], rtol=6e-5)
    np.testing.assert_allclose(in_plane, FV52[4:], rtol=7e-4)
    bending = np.array([b[:4] for b, _ in found])
    assert (np.diff(bending, axis=0) < -0.01 * bending[1:]).all()  # not converged, and never will be
    below = 1 - bending[-1] / FV52[:4]
    assert (below > 0.02).all() and (below < 0.09).all()


@pytest.mark.slow
@pytest.mark.parametrize("cell_type", BRICKS_SLOW)
def test_fv52_on_its_side_faces(cell_type):
    """uz = 0 on the four side faces: a support that a solid feels, and bending converges, to 44.18, 107.3, 163.1 Hz.

    3.7, 1.9 and 2.8 % below the targets, since these faces may still slide and twist along their edges, which the
    hard supports of the targets forbid. Tetrahedra are still 0.3 % stiff in the fourth mode.
    """
    found = []
    for n in ((4, 4, 1), (8, 8, 2), (16, 16, 4)):
        bending, _ = bending_and_in_plane(cell_type, n, [{"face": f, "directions": "z"} for f in RIM])
        found.append(bending[:4])
    last = assert_converged(found, 2.5e-2 if cell_type == "tetra10" else 6e-3)
    np.testing.assert_allclose(last, [44.18, 107.3, 107.3, 163.1], rtol=6e-3 if cell_type == "tetra10" else 2e-3)
    below = 1 - last / FV52[:4]
    assert (below > 0.015).all() and (below < 0.045).all()


def plate_wave(k, half_thickness):
    """Frequency, Hz, of the lowest antisymmetric Rayleigh-Lamb wave of wave number k (1/m)."""
    nu = METAL["poisson"]
    shear = np.sqrt(METAL["young"] / (2 * (1 + nu)) / METAL["density"])
    pressure = shear * np.sqrt(2 * (1 - nu) / (1 - 2 * nu))

    def equation(omega):
        p, q = (np.sqrt(complex((omega / c) ** 2 - k**2)) for c in (pressure, shear))
        ph, qh = p * half_thickness, q * half_thickness
        both = (q**2 - k**2) ** 2 * np.sin(ph) / p * np.cos(qh) + 4 * k**2 * q * np.sin(qh) * np.cos(ph)
        return both.real

    return brentq(equation, 1e-3 * k * shear, 0.9 * k * shear, rtol=1e-14) / (2 * np.pi)


@pytest.mark.parametrize("cell_type", CELLS_SLOW)
def test_fv52_between_hard_supports(cell_type):
    """Side faces held along z and along themselves, as the theory behind the targets has it: an exact solution.

    The modes are products of sines: Rayleigh-Lamb waves of wave number pi / a sqrt(m^2 + n^2), 45.971, 109.857,
    168.819, 205.865 Hz, and shear waves in the plane, 155.04 and 219.26 Hz. Mindlin's plate (the first of the targets,
    and Test 21: 45.897, 109.44, 167.89, 204.51 Hz) lies 0.2 to 0.7 % below three dimensions. Errors of solids fall
    with the fourth power of the cell size, to 0.05 % (bricks) and 0.2 % (tetrahedra) in the highest mode.
    """
    waves = [(1, 1), (1, 2), (2, 1), (2, 2), (1, 3), (3, 1)]
    lamb = np.array([plate_wave(np.pi / 10 * np.hypot(m, n), 0.5) for m, n in waves])
    shear = np.sqrt(METAL["young"] / 2.6 / METAL["density"])
    in_plane = [shear * np.hypot(m, n) / 20 for m, n in ((1, 0), (0, 1), (1, 1))]
    exact = np.sort([*lamb, *in_plane])
    supports = [{"face": f, "directions": "yz" if f[0] == "x" else "xz"} for f in RIM]
    errors = []
    for n in ((4, 4, 1), (8, 8, 2), (16, 16, 4)):
        frequency, _ = solid_plate(cell_type, n, 9, supports=supports)
        errors.append(frequency[:9] / exact - 1)
    flat = cell_type == "tetra10"
    assert (errors[-1] > 0).all() and (errors[-1] < (2.5e-3 if flat else 6e-4)).all()
    slopes = np.log2(errors[1] / errors[2])  # twice the order of the strain: four
    assert (slopes > (3.6 if flat else 3.8)).all() and (slopes < 4.1).all()
    mindlin = np.array([45.897, 109.44, 109.44, 167.89, 204.51, 204.51])
    below = 1 - mindlin / lamb
    assert (below > 1e-3).all() and (below < 7e-3).all()


# ---------------------------------------------------------------- a rotating disc


@pytest.mark.parametrize("between", [True, False], ids=["between walls", "thin"])
@pytest.mark.parametrize("cell_type", CELLS)
def test_rotating_disc(cell_type, between):
    """A quarter of a steel disc with a hole, radii 0.1 and 0.5 m, 3000 rpm: hoop stress at the hole and growth.

    No NAFEMS number. Between smooth walls the closed form is exact (nu replaced by nu / (1 - nu)). The thin disc of
    half thickness c = 0.01 m grows more in its middle plane than the theory of plane stress, by
    nu (1 + nu) / 6 c^2 over ((1 - nu) b^2 + (3 + nu) a^2) / 4, 1.25e-4. One linear solution at speed.
    Stress at the hole is an extrapolation of order one to two: 0.3 %, tetrahedra 0.7 %.
    """
    a, b, c, omega, E, nu = 0.1, 0.5, 0.01, 100 * np.pi, STEEL["young"], STEEL["poisson"]
    v = nu / (1 - nu) if between else nu
    load = STEEL["density"] * omega**2 / 4
    hole = load * ((3 + v) * b**2 + (1 - v) * a**2)
    rim = load * ((1 - v) * b**2 + (3 + v) * a**2)
    growth = rim * b / E * (1 - nu**2 if between else 1 + 4 * nu * (1 + nu) / 6 * c**2 * load / rim)
    faces = ("z0", "z1") if between else ("z0",)
    supports = [*QUARTER, *({"face": f, "directions": "z"} for f in faces)]
    errors = []
    for n in (3, 6, 12):
        grow = graded(n, 3)

        def to(p, grow=grow):
            r = a + (b - a) * grow(p[:, 0])
            return np.column_stack([r * np.cos(p[:, 1]), r * np.sin(p[:, 1]), p[:, 2]])

        mesh = brick(cell_type, (n, n, 1), (1, np.pi / 2, c), to=to)
        rotation = {"axis": [0.0, 0.0, 1.0], "speeds_rpm": [3000.0], "prestress": "linear"}
        u, stress = static(mesh, material=STEEL, supports=supports, rotation=rotation)
        errors.append([stress[nearest(mesh, (a, 0, 0)), 1] / hole - 1, u[nearest(mesh, (b, 0, 0)), 0] / growth - 1])
    stress, moved = np.abs(np.transpose(errors))
    assert moved[-1] < 3e-5 and np.log2(moved[0] / moved[-1]) / 2 > 2.9  # order three (tetrahedra) to four
    assert stress[-1] < (8e-3 if cell_type == "tetra10" else 4e-3) and (stress[1:] < 0.5 * stress[:-1]).all()
