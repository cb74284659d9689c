"""Excitation: engine orders on a ring against the force that every blade feels, magnets, pressure fields, damping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rings
import scipy.integrate
import scipy.linalg
import scipy.optimize
import small
from meshes import body
from refusals import refused
from test_assembly import FINE, blade, sector

from microslip.data import ModalBasis
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.solver import solve
from microslip.modal.compute import modal_basis
from microslip.ring.expansion import aliased
from microslip.system import damping, excitation, pressure
from microslip.system.assembly import Assembly, Load, Output
from microslip.system.component import Component, Ring

# ---------------------------------------------------------------- engine orders and patterns


@pytest.mark.parametrize("turning", [1, -1])
@pytest.mark.parametrize("blades", [7, 12])
def test_engine_orders_against_the_force_that_every_blade_feels(blades: int, turning: int) -> None:
    """Three unequal magnets stand round a rotor: the force on each blade, sampled in time as it passes them and
    Fourier transformed, is what the loads of the unrolled ring say, to the last digits."""
    pattern = excitation.magnets(np.radians([10.0, 95.0, 260.0]), np.array([3.0, 1.0, 2.0]), 0.7, 8)
    ring = Ring(blades, turning * excitation.base_order(pattern.orders()))
    place = 0.3
    loads = excitation.pattern_loads("blade", "gas", pattern, ring, place, turning)
    one = Assembly((Component("blade", {0: blade().groups[0, 0]}),), (), loads, (), ring)
    t = 2 * np.pi * np.arange(64) / 64  # Omega t over one turn; the base order is 1
    for j in range(blades):
        felt = pattern.at(place + 2 * np.pi * j / blades + turning * t)
        expected = np.fft.rfft(felt)[:9] * np.r_[1, np.full(8, 2)] / 64
        told = np.zeros(9, dtype=complex)
        for x in one.unrolled().loads:
            if x.component == f"blade_{j}":
                told[x.harmonic] += x.amplitude
        np.testing.assert_allclose(told, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("turning", [1, -1])
def test_waves_run_as_aliasing_says(turning: int) -> None:
    """Nodal diameter and direction of every engine order on 24 blades: those of `ring.aliased`; a rotor that turns the
    other way sees the same directions, because the pattern then comes from the other side."""
    for order in range(1, 60):
        ring = Ring(24, turning * order)
        k, sense = excitation.direction(ring.index(1), 24, turning)
        assert (k, sense) == aliased(order, 24)
        assert excitation.index_of(k, sense, 24, turning) == ring.index(1)


def test_several_orders_are_harmonics_of_their_common_divisor() -> None:
    ring = Ring(30, excitation.base_order([6, 9, 15]))
    assert ring.order == 3
    assert [excitation.harmonic_of(e, ring) for e in (6, 9, 15)] == [2, 3, 5]


def test_three_equal_magnets_excite_every_third_order() -> None:
    """Sextro section 5.4: three magnets at equal distances, engine order three and multiples; unequal ones the rest."""
    angles = np.radians([0.0, 120.0, 240.0])
    assert excitation.magnets(angles, 2.0, 0.4, 14).orders() == (3, 6, 9, 12)
    assert excitation.magnets(angles, np.array([2.0, 2.0, 2.1]), 0.4, 5).orders() == (1, 2, 3, 4, 5)
    assert excitation.magnets(np.radians([0.0, 120.0, 241.0]), 2.0, 0.4, 5).orders() == (1, 2, 3, 4, 5)


@pytest.mark.parametrize("pulse", ["cosine", "rectangular"])
@pytest.mark.parametrize("width", [0.3, 2 * np.pi / 3, 2 * np.pi])
def test_fourier_coefficients_of_a_pulse_are_its_integrals(pulse: str, width: float) -> None:
    """c(e) = integral of the pulse times cos(e theta), by adaptive quadrature, 1e-10; at e width = 2 pi too, where the
    closed form of the cosine pulse is a limit."""
    height = {"cosine": lambda x: np.cos(np.pi * x / width) ** 2, "rectangular": lambda x: 1.0}[pulse]
    found = excitation.magnets(np.zeros(1), 1.0, width, 6, pulse).amplitudes
    for e in range(7):
        exact = scipy.integrate.quad(lambda x, e=e: height(x) * np.cos(e * x), -width / 2, width / 2, epsabs=1e-13)[0]
        assert found[e] == pytest.approx(exact / np.pi * (0.5 if e == 0 else 1.0), abs=1e-10)


@pytest.mark.slow
def test_several_orders_at_once_on_a_sector_are_those_on_the_ring() -> None:
    """Engine orders 2, 4 and 6 with phases of their own on blades that rub: every blade of the whole ring moves as the
    sector says, 1e-9, and the energy that comes in is the ring's, N times the sector's, and above 0."""
    blades, Omega = 6, 2 * np.pi * 25.0
    ring = Ring(blades, excitation.base_order([2, 4, 6]))
    loads = tuple(
        Load("blade", "gas", a * np.exp(1j * phase), excitation.harmonic_of(e, ring))
        for a, e, phase in ((4, 2, 0.4), (3, 4, 2.0), (2, 6, -1))
    )
    one = replace(sector(blades, 2), loads=loads, ring=ring)
    lone, whole = balance.of(one, **FINE), balance.of(one.unrolled(), **FINE)
    a, b = solve(lone, Omega, []), solve(whole, Omega, [])
    assert a.converged and b.converged
    x, y = response.operating(lone, a), response.operating(whole, b)
    h, j = np.arange(4), np.arange(blades)[:, None]
    turned = x.outputs[0] * np.exp(2j * np.pi * h * 2 * j / blades)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert y.supplied == pytest.approx(blades * x.supplied, rel=1e-9)
    assert x.supplied > 0
    assert x.cycles["shroud"].slipping.mean() > 0


def test_a_centrifugal_load_moves_a_loose_body_by_its_statics() -> None:
    """A beam whose centrifugal force is an excitation: the tip of a bar moves by Omega^2 rho / E (r_0 L^2 / 2 +
    L^3 / 3), which Rubin's basis holds."""
    axis = {"rotation": {"speeds_rpm": [0.0], "point": [0.0, 0.0, -0.2]}}
    rows = [{"name": "spin", "centrifugal": True}]
    changes = {"excitations": rows, "reduction": "rubin", **axis}
    g = modal_basis(small.beam(), small.BodySettings.model_validate(small.table(**changes))).groups[0, 0]
    load = Load("beam", "spin", 100.0**2, 0)
    one = Assembly((Component("beam", {0: g}),), (), (load,), (Output("beam", "tip-probe", "u_z"),))
    part = one.part(one.components[0], 0)
    tip = part.output @ np.linalg.solve(part.K, part.load)
    E, rho, L, r0 = 2.1e11, 7850.0, small.SIZE[2], 0.2
    bar = 100.0**2 * rho / E * (r0 * L**2 / 2 + L**3 / 3)  # integral of the force outside, over E A
    assert tip[0] == pytest.approx(bar, rel=0.02)  # the clamp holds the root's contraction


def test_mistakes_are_told() -> None:
    for words, call in (
        ("none is given but 0", lambda: excitation.base_order([0])),
        ("no multiple of the base order 4", lambda: excitation.harmonic_of(6, Ring(24, 4))),
        ("the other way round", lambda: excitation.harmonic_of(-4, Ring(24, 4))),
        ("24 blades have 0 to 12", lambda: excitation.index_of(13, "forward", 24)),
        ("at most a whole turn", lambda: excitation.magnets(np.zeros(1), 1.0, 7.0, 3)),
    ):
        refused(words, call)
    loads = (Load("blade", "gas", 1.0, 5), Load("blade", "gas", 1.0, 2))
    (told,) = excitation.unheard(loads, 3)
    assert "harmonic 5" in told and "raise harmonics to 5" in told


# ---------------------------------------------------------------- pressure fields


N = 6


@pytest.fixture(scope="module")
def disc() -> ModalBasis:
    """A sector of a bladed disc whose shroud's right face is loaded: complex shapes between 0 and N/2."""
    settings = body(
        supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 6},
        excitations=[{"name": "gas", "face": "contact_right", "pressure": True}],
        rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [0.0]}, output={"gauss": False, "nodal_stress": False},
    )  # fmt: skip
    return modal_basis(rings.bladed_sector("hexahedron20", N), settings)


@pytest.fixture(scope="module")
def beam() -> Component:
    return Component("beam", {0: small.basis().groups[0, 0]})


def grid(count: int = 30) -> np.ndarray:
    """Points on the beam's face x = 0 and a little beyond its edges."""
    y, z = np.meshgrid(np.linspace(-0.001, 0.031, count), np.linspace(-0.002, 0.122, 2 * count))
    return np.column_stack([np.zeros(y.size), y.ravel(), z.ravel()])


def field(function, count: int = 30) -> pressure.PressureField:
    points = grid(count)
    return pressure.PressureField(points, function(*points.T).astype(complex), "field")


def test_a_uniform_field_is_the_unit_pressure(beam: Component) -> None:
    """Modal force of p = 3 + 4i everywhere: that of the row `gas` times p; the resultant is - area times normal."""
    found = pressure.on_face(field(lambda x, y, z: 3 + 4j + 0 * x), pressure.load_face(beam, "contact_left"), "left")
    np.testing.assert_allclose(found.force, [(3 + 4j) * 0.03 * 0.12, 0, 0], rtol=0, atol=1e-15)  # the normal is -x
    assert found.error < 1e-12
    part = modal_force(pressure.with_pressure(beam, "flow", found), pressure.field_loads("beam", "flow", 1))
    np.testing.assert_allclose(part, modal_force(beam, (Load("beam", "gas", 3 + 4j),)), rtol=1e-12)


def modal_force(component: Component, loads: tuple[Load, ...], ring: Ring | None = None) -> np.ndarray:
    return Assembly((component,), (), loads, (), ring).part(component, 1).load


def test_a_linear_field_is_exact_and_a_wavy_one_converges(beam: Component) -> None:
    """Resultants against integrals in closed form: 1e-12 for a linear pressure on scattered points, second order in
    the field's spacing for a sine; the error told is above the true one, and below thirty times it."""
    face = pressure.load_face(beam, "contact_left")
    rng = np.random.default_rng(2)
    points = grid(12) + np.column_stack([np.zeros(12 * 24), *rng.uniform(-1e-3, 1e-3, size=(2, 12 * 24))])
    linear = pressure.PressureField(points, 1.0 + 2j * points[:, 1] - 5 * points[:, 2] + 0j)
    exact = 0.03 * 0.12 * (1 + 2j * 0.015 - 5 * 0.06)
    assert pressure.on_face(linear, face, "left").force[0] == pytest.approx(exact, rel=1e-12)

    def wave(x, y, z):
        return np.exp(1j * np.pi * z / 0.06) * np.cos(np.pi * y / 0.06)

    true = wave(*face.points.T)
    errors, told = [], []
    counts = np.array([10, 14, 20, 28, 40, 56])
    for count in counts:
        found = pressure.on_face(field(wave, count), face, "left")
        rms = np.sqrt(face.areas @ np.abs(true) ** 2)
        errors.append(np.sqrt(face.areas @ np.abs(found.pressure - true) ** 2) / rms)
        told.append(found.error)
    slope = np.polyfit(np.log(1 / (counts - 1)), np.log(errors), 1)[0]
    assert 1.7 < slope < 2.6
    assert np.all(np.array(told) > errors) and np.all(np.array(told) < 30 * np.array(errors))
    assert errors[-1] < 1e-3


def test_the_other_side_of_a_thin_blade_does_not_mix_in(beam: Component) -> None:
    """A field on both sides of a plate nine spacings wide and two thick, of opposite sign: each face takes its own."""
    near, count = grid(20), 20 * 40
    spacing = 0.032 / 19
    far = near + [2 * spacing, 0, 0]
    both = pressure.PressureField(np.vstack([near, far]), np.r_[np.ones(count), -np.ones(count)] + 0j)
    found = pressure.on_face(both, pressure.load_face(beam, "contact_left"), "left")
    np.testing.assert_allclose(found.pressure, 1.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4, 5])
def test_a_complex_field_on_a_sector_of_complex_shapes(disc: ModalBasis, order: int) -> None:
    """Modal force of every wave of six sectors, those of the conjugate groups too: phi^H against the pressure, point by
    point, with the shapes of the wave itself. A field of one order excites its own wave on the whole ring only."""
    component = Component("disc", {k: g for (_, k), g in disc.groups.items()}, sectors=N)
    face = pressure.load_face(component, "contact_right")
    p = np.exp(1j * 20 * face.points[:, 0]) * (1 + face.points[:, 2])
    found = pressure.FacePressure(p, np.zeros(3, complex), 0.0, 0.0, "field", "contact_right")
    loaded = pressure.with_pressure(component, "flow", found)
    f = modal_force(loaded, pressure.field_loads("disc", "flow", 1, 2.0), Ring(N, order))
    k = min(order, N - order)
    shapes = component.groups[k].interfaces["contact_right"].shapes
    phi = shapes.conj() if order > N / 2 else shapes
    direct = -2.0 * np.einsum("p,p,pi,pim->m", face.areas, p, face.normals, phi.conj())
    np.testing.assert_allclose(f, direct, rtol=0, atol=1e-12 * np.abs(direct).max())


def test_files_of_a_field(tmp_path, beam: Component) -> None:
    """The same field from .csv in millimetres, .npz and .vtu: the same modal force; exp(-i Omega t) is conjugated."""
    meshio = pytest.importorskip("meshio")
    points, face = grid(15), pressure.load_face(beam, "contact_left")
    p = (1 + 1j) * points[:, 2]
    columns = dict(zip(pressure.COLUMNS, [*points.T, p.real, p.imag], strict=True))
    table = np.column_stack([1e3 * points, p.real, p.imag])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=",".join(pressure.COLUMNS), comments="")
    np.savez(tmp_path / "b.npz", **columns)
    data = {"p_real": p.real, "p_imag": p.imag}
    meshio.write_points_cells(tmp_path / "c.vtu", points, [("vertex", np.arange(len(p))[:, None])], point_data=data)
    direct = pressure.on_face(pressure.PressureField(points, p), face, "left")
    for name, unit in (("a.csv", "mm"), ("b.npz", "m"), ("c.vtu", "m")):
        found = pressure.on_face(pressure.read_field(tmp_path / name, unit), face, "left")
        np.testing.assert_allclose(found.pressure, direct.pressure, rtol=1e-9)
        assert "N;" in found.sentence() and name in found.sentence()
    turned = pressure.read_field(tmp_path / "a.csv", "mm", conjugate=True)
    np.testing.assert_allclose(turned.pressure, p.conj(), rtol=1e-9)


def test_bad_fields_are_refused_in_a_sentence(tmp_path, beam: Component) -> None:
    face = pressure.load_face(beam, "contact_left")
    good = "x,y,z,p_real,p_imag\n" + "\n".join(f"0,{y},{z},1,0" for y in (0, 15, 30) for z in (0, 60, 120))
    path = tmp_path / "field.csv"
    path.write_text(good)
    beside = pressure.PressureField(grid() + [0.5, 0, 0], np.ones(1800) + 0j)
    refused("length_unit mm instead of m", pressure.on_face, pressure.read_field(path, "m"), face, "left")
    refused(("does not cover face 'left'", " m away"), pressure.on_face, beside, face, "left")
    refused("'furlong' is none of", pressure.read_field, path, "furlong")
    for text, words in (
        (good.replace("p_real", "p"), "has no p_real"),
        (good.replace("0,15,60,1,0", "0,15,60,one,0"), "could not convert string to float: 'one'"),
        (good.replace("0,15,60,1,0", "0,15,60,nan,0"), "point 5 holds something that is no finite number"),
        (good.replace("0,15,60,1,0", "0,15,60,1"), "point 5 has 4 values"),
        ("x,y,z,p_real\n0,0,0,1\n", "three points or more"),
        ("", "has no x, y, z, p_real"),
    ):
        path.write_text(text)
        refused(words, pressure.read_field, path, "mm")
    for name, what in (("a.npz", "cannot be read as an .npz"), ("a.vtu", "is damaged"), ("a.xyz", "not read from")):
        (tmp_path / name).write_bytes(b"PK\x03\x04 damaged")
        refused(what, pressure.read_field, tmp_path / name, "m")
    refused("no such file", pressure.read_field, tmp_path / "nowhere.csv", "m")
    refused("has no face 'tip' with points", pressure.load_face, beam, "tip")
    bare = replace(beam.groups[0].interfaces["contact_left"], shapes=np.zeros((0, 3, 6)))
    part = Component("beam", {0: replace(beam.groups[0], interfaces={"contact_left": bare})})
    on_bare = pressure.on_face(field(lambda x, y, z: z), bare, "contact_left")
    refused("output.patch_shapes", pressure.with_pressure, part, "flow", on_bare)


# ---------------------------------------------------------------- damping


def half_power(M: float, K: complex, C: complex) -> tuple[float, float]:
    """Where |1/(K - w^2 M + i w C)|^2 has half of its largest value, rad/s."""

    def response_at(w: float) -> float:
        return abs(1 / (K - w**2 * M + 1j * w * C))

    w0 = np.sqrt(abs(K / M))
    top = scipy.optimize.minimize_scalar(lambda w: -response_at(w), bounds=(0.9 * w0, 1.1 * w0), method="bounded",
                                         options={"xatol": 1e-10 * w0})  # fmt: skip
    level = -top.fun / np.sqrt(2)
    return tuple(
        scipy.optimize.brentq(lambda w: response_at(w) - level, *sorted((top.x, edge * w0))) for edge in (0.5, 1.5)
    )


def test_aerodynamic_damping_is_the_half_power_width(tmp_path, disc: ModalBasis) -> None:
    """Forward and backward waves of one nodal diameter with ratios of their own: each wave's FRF is as wide as its
    ratio and the body's together, and shifted as told: widths 4 D sqrt(1 - D^2) of the squared frequencies, 1e-6."""
    path = tmp_path / "aero.csv"
    rows = ["nodal_diameter,direction,frequency_shift,damping_ratio", "0,both,0,0.01", "1,forward,0.002,0.03",
            "1,backward,-0.001,0.004", "2,both,0,0.02", "3,both,0.01,0.005"]  # fmt: skip
    path.write_text("\n".join(rows))
    flow = damping.read_aerodynamics(path, N)
    groups = {k: damping.with_ratios(g, 0.003) for (_, k), g in disc.groups.items()}
    component = Component("disc", groups, sectors=N, aerodynamic=flow)
    expected = {0: 0.01, 1: -0.001 + 0.004j, 5: 0.002 + 0.03j, 2: 0.02j, 4: 0.02j, 3: 0.01 + 0.005j}
    for index, value in (expected | {0: 0.01j}).items():
        assert flow[index] == value
        M, K, C = (np.diag(A) for A in component.at(index).matrices)
        for j, omega in enumerate(component.at(index).group.omega[:3]):
            D, shifted = 0.003 + value.imag, omega * np.sqrt(1 + 2 * value.real)
            low, high = half_power(M[j], K[j], C[j])
            D = D * omega / shifted  # C keeps the frequency that the modal file holds
            assert (high**2 - low**2) / shifted**2 == pytest.approx(4 * D * np.sqrt(1 - D**2), rel=1e-6)
        np.testing.assert_allclose(damping.total_damping(component, index), 0.003 + value.imag, rtol=1e-12)


def test_the_rotors_sense_decides_which_wave_is_forward(tmp_path) -> None:
    path = tmp_path / "aero.csv"
    path.write_text(
        "nodal_diameter,direction,frequency_shift,damping_ratio\n0,,0,0\n1,forward,0,0.01\n1,backward,0,0.02\n"
    )
    assert damping.read_aerodynamics(path, 3) == {0: 0, 1: 0.02j, 2: 0.01j}
    assert damping.read_aerodynamics(path, 3, turning=-1) == {0: 0, 1: 0.01j, 2: 0.02j}


def test_flutter_is_told_by_mode_and_wave(disc: ModalBasis) -> None:
    flow = {k: -0.004j if k == 5 else 0.001j for k in range(N)}
    groups = {k: damping.with_ratios(g, [0.003, 0.005]) for (_, k), g in disc.groups.items()}
    told = damping.unstable(Component("disc", groups, sectors=N, aerodynamic=flow), N)
    assert len(told) == 1
    assert "disc: mode 1" in told[0] and "nodal diameter 1, forward" in told[0] and "-0.001" in told[0]
    M, K, C = Component("disc", groups, sectors=N, aerodynamic=flow).at(5).matrices
    zero, one = np.zeros_like(M), np.eye(len(M))
    roots = scipy.linalg.eigvals(np.block([[zero, one], [-K, -C]]), scipy.linalg.block_diag(one, M))
    assert (roots.real > 0).sum() == 2  # the mode and its conjugate


FLOW = {0: 0.01j, 1: 0.004 + 0.02j, 2: -0.01 + 0.005j, 3: 0.002 + 0.01j, 4: 0.03j, 5: 0.01 - 0.002j}
"""Of six sectors, or of fewer; the two directions of a nodal diameter differ."""


WAVES = [(5, -1), *(pytest.param(6, e, marks=pytest.mark.slow) for e in (-1, 2))]
"""Blades of a ring and engine order."""


@pytest.mark.parametrize(("blades", "order"), WAVES)
def test_flow_couples_the_blades_of_a_whole_ring(blades: int, order: int) -> None:
    """Influence coefficients between lone blades with sliding contacts: the sector in the wave of every harmonic, 1e-9;
    where they are the same in all waves each blade has its own."""
    one, flow = sector(blades, order), {wave: FLOW[wave] for wave in range(blades)}
    same, flown = (replace(one.components[0], aerodynamic=a) for a in (dict.fromkeys(flow, 0.01j), flow))
    assert replace(one, components=(same,)).unrolled().components[3].at(0).aerodynamic == 0.01j
    alone = replace(one, components=(flown,))
    problems = (balance.of(a, **FINE) for a in (one, alone, alone.unrolled()))
    still, x, y = (response.operating(p, solve(p, 2 * np.pi * 58.0, [])) for p in problems)
    h = np.arange(x.outputs.shape[1])
    turned = x.outputs[0] * np.exp(2j * np.pi * h * order * np.arange(blades)[:, None] / blades)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert y.damped == pytest.approx(blades * x.damped, rel=1e-9)
    q, before = (np.concatenate([np.ravel(v) for v in a.q["blade"]]) for a in (x, still))
    assert np.abs(q - before).max() > 0.01 * np.abs(before).max()


@pytest.mark.parametrize("reduction", ["eigenmodes", "craig-bampton"])
def test_ratios_by_mode_in_any_coordinates(reduction: str) -> None:
    """The damped eigenvalues of the reduced matrices: -D omega +- i omega sqrt(1 - D^2), 1e-9, in modes and in
    coordinates of the interfaces."""
    settings = small.BodySettings.model_validate(small.table(reduction=reduction))
    g = damping.with_ratios(modal_basis(small.beam(), settings).groups[0, 0], [0.01, 0.03, 0.002])
    m = len(g.M_r)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(g.M_r, g.K_r), -np.linalg.solve(g.M_r, g.C_r)]])
    roots = np.linalg.eigvals(A)
    roots = roots[roots.imag > 0]
    roots = roots[np.argsort(np.abs(roots))]
    D = np.r_[0.01, 0.03, np.full(len(g.omega) - 2, 0.002)]
    np.testing.assert_allclose(roots, g.omega * (-D + 1j * np.sqrt(1 - D**2)), rtol=1e-8)
    for bad in ([], [-0.1], [np.nan]):
        refused("none negative", damping.with_ratios, g, bad)


def test_bad_aerodynamic_tables_are_refused_in_a_sentence(tmp_path) -> None:
    path, head = tmp_path / "aero.csv", "nodal_diameter,direction,frequency_shift,damping_ratio\n"
    for text, words in (
        ("nodal_diameter,ratio\n1,2\n", "has no column frequency_shift, damping_ratio"),
        (head + "0,,0,0\n1,forward,0,0\n", "lacks the waves of nodal diameter 1, backward"),
        (head + "0,,0,0\n1,,0,0\n1,forward,0,0\n", "line 4: nodal diameter 1, forward, is given twice"),
        (head + "2,,0,0\n", "line 2: nodal diameter 2: 3 blades have 0 to 1"),
        (head + "0,,0,50\n", "shares of 1"),
        (head + "0,sideways,0,0\n", "'sideways' must be forward, backward or both"),
        (head + "0.5,,0,0\n", "a whole number and two numbers"),
    ):
        path.write_text(text)
        refused(words, damping.read_aerodynamics, path, 3)
    refused("there is no such table", damping.read_aerodynamics, tmp_path / "nowhere.csv", 3)
