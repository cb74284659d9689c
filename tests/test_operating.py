"""Displacement, stress over the cycle and fatigue of a vibrating body, from its modal coordinates alone.

The bar bent by a harmonic tip force has a closed form; what is read by the rows of the modal file is found a second
time from the displacement of the elements.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meshes import body, brick
from pydantic import ValidationError
from refusals import refused
from small import basis as small_basis

from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise
from microslip.fem.operators import displacement_gradient, green_strain
from microslip.modal.compute import modal_basis
from microslip.modal.stress import von_mises
from microslip.operating import MaterialLimits, motion_of
from microslip.operating.cycle import amplitude, at_time, longest, wave_top
from microslip.operating.fatigue import (
    allowed_amplitude,
    away_from,
    endurance,
    proportional_margin,
    vibration_margin,
    worst,
)
from microslip.operating.motion import displacement, nearest_point, point_numbered, read_out
from microslip.operating.stress import cycle_stress, equivalent, stress_at, stress_peaks

RNG = np.random.default_rng(3)
LIMITS = MaterialLimits(fatigue_strength=300e6, tensile_strength=900e6, yield_strength=700e6)


def wave(*shape: int) -> np.ndarray:
    return RNG.normal(size=shape) + 1j * RNG.normal(size=shape)


# ---------------------------------------------------------------- waves


def over_time(a: np.ndarray, samples: int = 20000) -> np.ndarray:
    """(samples, ...) of harmonics along the first axis, term by term."""
    t = 2 * np.pi * np.arange(samples) / samples
    found = np.multiply.outer(np.ones(samples), a[0].real)
    for h in range(1, len(a)):
        found += np.multiply.outer(np.cos(h * t), a[h].real) - np.multiply.outer(np.sin(h * t), a[h].imag)
    return found


@pytest.mark.parametrize("order", [1, 2, 3, 7])
def test_top_value_of_a_wave(order):
    """Against 20000 samples, which miss the top by at most sum |a_n| n^2 (pi/20000)^2/2."""
    a = wave(500, order + 1)
    found, sampled = wave_top(a, 16), over_time(a.T).max(axis=0)
    missed = np.abs(a) @ np.arange(order + 1) ** 2 * (np.pi / 2e4) ** 2 / 2
    assert (found > sampled - 1e-9).all() and (found < sampled + missed + 1e-9).all()


def test_longest_axis_of_an_ellipse():
    a = wave(50, 3)
    sampled = np.linalg.norm(over_time(np.stack([0 * a, a])), axis=-1).max(axis=0)
    np.testing.assert_allclose(longest(a), sampled, rtol=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_equivalent_stress_over_the_cycle_against_samples(order):
    """Amplitude, mean and largest von Mises stress of six independent components, each with phases of its own."""
    sigma = 1e6 * wave(40, order + 1, 6)
    mean, alternating, largest = equivalent(sigma)
    time = over_time(np.moveaxis(sigma, 1, 0))
    steady = sigma[:, 0].real
    np.testing.assert_allclose(largest, von_mises(time).max(axis=0), rtol=1e-5)
    np.testing.assert_allclose(alternating, von_mises(time - steady).max(axis=0), rtol=1e-5)
    np.testing.assert_allclose(mean, np.sign(steady[:, :3].sum(axis=1)) * von_mises(steady), rtol=1e-12)
    np.testing.assert_allclose(equivalent(sigma, True)[1], equivalent(sigma[:, :2])[1], rtol=1e-12)


def test_amplitude_of_a_signal_with_harmonics():
    """cos t - cos(3 t)/4 swings to |x| = 4/3 sqrt(7/12)... : against samples; one harmonic alone: its modulus."""
    a = np.array([[2.0, 1.0, 0.0, -0.25]], dtype=complex)
    assert amplitude(a, axis=1)[0] == pytest.approx(np.abs(over_time(a.T)[:, 0] - 2.0).max(), rel=1e-7)
    assert amplitude(np.array([[0.3, 3 - 4j]]), axis=1)[0] == pytest.approx(5.0)
    assert at_time(np.array([[0.3, 3 - 4j]]), np.pi / 2)[0] == pytest.approx(0.3 + 4)


# ---------------------------------------------------------------- closed form: a bar under a harmonic tip force


LENGTH, SIDE = 0.2, 0.02
GAUGE = 3.5 * LENGTH / 12  # the middle of a brick
BEND = {"supports": [{"face": "z0"}]}


@cache
def bar():
    """A slender steel bar along z of 27-node bricks, clamped at z = 0, Poisson's ratio 0 as the beam has it."""
    mesh = brick("hexahedron27", (2, 2, 12), (SIDE, SIDE, LENGTH))
    settings = body(
        **BEND,
        material={"density": 7850.0, "young": 2.1e11, "poisson": 0.0},
        modes={"count": 30},
        excitations=[{"name": "tip", "face": "z1", "direction": [1.0, 0.0, 0.0]}],
        monitors=[{"name": "end", "point": [SIDE / 2, SIDE / 2, LENGTH]}],
        gauges=[{"name": "root", "point": [SIDE, SIDE / 2, GAUGE], "direction": [0.0, 0.0, 1.0]}],
        reduction="rubin",
        output={"gauss": True, "nodal_stress": True},
    )
    return modal_basis(mesh, settings)


def shaken(force: float, Omega: float, mean: float = 0.0):
    """The bar under force cos(Omega t) + mean at its tip: coordinates by the reduced equation of motion."""
    group = bar().groups[0, 0]
    f = group.excitations["tip"].rows[0]
    q = [np.linalg.solve(group.K_r - (h * Omega) ** 2 * group.M_r, s * f) for h, s in ((0, mean), (1, force))]
    return motion_of(Omega, np.array(q), group)


def test_stress_of_a_bar_bent_slowly_by_a_harmonic_force():
    """sigma = F (l - z) 6 / b^3 at the outer fibre (Euler-Bernoulli, static far below the first mode).

    Half-way the disturbances of clamp and tip, as long as the section is wide, are gone; 0.5 % for the mesh and the
    4 parts in 10^4 that the inertia adds at a fiftieth of the first frequency.
    """
    force, mean = 100.0, 40.0
    motion = shaken(force, bar().groups[0, 0].omega[0] / 50, mean)
    cycle = cycle_stress(motion)
    z, x = cycle.points[:, 2], cycle.points[:, 0]
    fibre = np.flatnonzero((np.abs(z - LENGTH / 2) < 1e-9) & (np.abs(x - SIDE) < 1e-9))
    told = 6 * force * (LENGTH / 2) / SIDE**3
    assert len(fibre) > 2
    np.testing.assert_allclose(cycle.amplitude[fibre], told, rtol=5e-3)
    np.testing.assert_allclose(np.abs(cycle.mean[fibre]), told * mean / force, rtol=5e-3)
    np.testing.assert_allclose(cycle.largest[fibre], told * (1 + mean / force), rtol=5e-3)
    assert (np.sign(cycle.mean[fibre]) == -1).all()  # pushed towards +x the side x = b is compressed
    strain = read_out(motion, "root", "gauges")[0, :, 0]
    told = 6 * np.array([mean, force]) * (LENGTH - GAUGE) / SIDE**3 / 2.1e11
    np.testing.assert_allclose(np.abs(strain), told, rtol=5e-3)


def test_goodman_margin_of_the_bar_by_hand():
    """At the fibre in tension sigma_a = 6 F (l - z)/b^3 and sigma_m = 0.4 sigma_a: 1/n = sigma_a/300 + sigma_m/900."""
    force, mean = 1000.0, 400.0
    motion = shaken(force, bar().groups[0, 0].omega[0] / 50, mean)
    cycle = cycle_stress(motion)
    middle = np.flatnonzero(np.abs(cycle.points[:, 2] - LENGTH / 2) < 1e-9)
    found = endurance(cycle, LIMITS, middle)
    a = 6 * force * (LENGTH / 2) / SIDE**3
    assert found.vibration == pytest.approx(300e6 * (1 - 0.4 * a / 900e6) / a, rel=6e-3)
    assert found.proportional == pytest.approx(1 / (a / 300e6 + 0.4 * a / 900e6), rel=6e-3)
    assert found.yielding == pytest.approx(700e6 / (1.4 * a), rel=6e-3)
    assert found.point[0] == pytest.approx(0.0, abs=1e-9) and found.mean > 0  # tension is the worse side


def test_resonant_stress_goes_with_the_slope_of_the_mode():
    """At the first bending resonance sigma_root = E b/2 w''(0), w'' = 3.516 w_tip/l^2 (clamped-free beam).

    2 % at the outer fibre of the cross section a twentieth of the length from the clamp, against the beam's own shape.
    """
    group, tip = bar().groups[0, 0], 1e-3
    j = int(np.argmax(np.abs(group.excitations["tip"].rows[0, :4])))  # of the pair the one that bends along x
    end = int(nearest_point(bar(), [SIDE / 2, SIDE / 2, LENGTH])[0])
    V = np.eye(group.n_modes) if group.to_diagonal is None else group.to_diagonal
    q = np.zeros((2, group.n_modes), dtype=complex)
    q[1] = V[:, j] if group.to_diagonal is not None else np.eye(group.n_modes)[j]
    motion = motion_of(group.omega[j], q, group)
    q[1] *= tip / np.linalg.norm(displacement(motion, end)[0, 1, 0])
    cycle = cycle_stress(motion_of(group.omega[j], q, group))
    k, s, z = 1.875104, 0.734096, LENGTH / 20
    bend = np.cosh(k * z / LENGTH) + np.cos(k * z / LENGTH) - s * (np.sinh(k * z / LENGTH) + np.sin(k * z / LENGTH))
    told = 2.1e11 * SIDE / 2 * tip * 0.5 * (k / LENGTH) ** 2 * bend
    near = np.argmin(np.linalg.norm(cycle.points - [SIDE, SIDE / 2, z], axis=1))
    height = cycle.points[near, 2]
    assert cycle.amplitude[near] == pytest.approx(told, rel=0.05 + 2 * abs(height - z) / LENGTH)


# ---------------------------------------------------------------- many places at once


@pytest.mark.parametrize("order", [1, 3])
def test_highest_of_a_sweep_is_that_of_every_point_by_itself(order, monkeypatch):
    """Blocks of places and the bound that spares most of them the search in time change nothing."""
    import microslip.operating.stress as room

    group = small_basis((0.0, 3000.0)).groups[1, 0]
    motion = motion_of(np.full(12, 300.0), 1e-4 * wave(12, order + 1, group.n_modes), group)
    each = [cycle_stress(motion, i) for i in range(12)]
    for memory in (room._MEMORY, 1):
        monkeypatch.setattr(room, "_MEMORY", memory)
        found = stress_peaks(motion)
        np.testing.assert_allclose(found.amplitude, [c.amplitude.max() for c in each], rtol=1e-9)
        np.testing.assert_allclose(found.largest, [c.largest.max() for c in each], rtol=1e-9)
        np.testing.assert_array_equal(found.place, [c.amplitude.argmax() for c in each])
        np.testing.assert_allclose(found.mean, [c.mean[c.amplitude.argmax()] for c in each], rtol=1e-9)
    book = stress_peaks(motion, first_harmonic=True)
    told = [longest(equivalent_first(c)).max() for c in each]
    np.testing.assert_allclose(book.amplitude, told, rtol=1e-12)


def equivalent_first(cycle) -> np.ndarray:
    from microslip.operating.stress import DEVIATOR

    return cycle.harmonics[:, 1] @ DEVIATOR.T


def test_static_stress_at_speed_is_in_the_mean():
    """A body that turns and does not vibrate: mean is the static stress, amplitude is nothing."""
    group = small_basis((0.0, 3000.0)).groups[1, 0]
    cycle = cycle_stress(motion_of(300.0, np.zeros((3, group.n_modes)), group))
    static = group.stresses["nodes"].static_stress
    np.testing.assert_allclose(cycle.largest, von_mises(static), rtol=1e-9)
    np.testing.assert_allclose(np.abs(cycle.mean), von_mises(static), rtol=1e-12)
    assert cycle.mean.max() > 1e6 and np.abs(cycle.amplitude).max() == 0


# ---------------------------------------------------------------- two ways


def test_stress_by_the_rows_is_that_of_the_displacement():
    """The stress rows against Hooke's law of the displacement gradient at the Gauss points, at several instants."""
    group, mesh = bar().groups[0, 0], bar().mesh
    motion = motion_of(500.0, 1e-4 * wave(3, group.n_modes), group)
    d = discretise(mesh)
    u, sigma = displacement(motion, np.arange(mesh.n_points))[0], stress_at(motion, slice(None), "gauss")[0]
    for angle in (0.0, 1.0, 4.0):
        now = at_time(u, angle, axis=0)
        strain = np.concatenate(
            [green_strain(displacement_gradient(b, now), nonlinear=False).reshape(-1, 6) for b in d.blocks]
        )
        told = strain @ isotropic(2.1e11, 0.0).T
        np.testing.assert_allclose(at_time(sigma, angle, axis=0), told, atol=1e-10 * np.abs(told).max())


def test_monitor_reads_what_the_nodes_do():
    group = small_basis().groups[0, 0]
    motion = motion_of(500.0, wave(2, group.n_modes), group)
    probe = group.monitors["tip-probe"]
    i, away = nearest_point(small_basis(), probe.point)
    assert away < 1e-12 and point_numbered(small_basis(), int(small_basis().mesh.node_id[i])) == i
    np.testing.assert_allclose(read_out(motion, "tip-probe")[0], displacement(motion, i)[0, :, 0], rtol=1e-9)


def test_residual_shapes_are_read_with_the_forces():
    """MacNeal: displacement is phi q + residual phi f, stress alike."""
    from small import beam, table

    from microslip.settings.body import BodySettings

    settings = BodySettings.model_validate(table(reduction="macneal", output={"nodal_stress": True}))
    group = modal_basis(beam(), settings).groups[0, 0]
    assert group.residual is not None
    r = len(group.residual.labels)
    q, f = wave(2, group.n_modes), 1e3 * wave(2, r)
    motion = motion_of(500.0, q, group, forces=f)
    told = group.phi[7] @ q[1] + group.residual.phi[7] @ f[1]
    np.testing.assert_allclose(displacement(motion, 7)[0, 1, 0], told, rtol=1e-9)
    told = group.stresses["nodes"].stress[7] @ q[1] + group.residual.stress["nodes"][7] @ f[1]
    np.testing.assert_allclose(stress_at(motion, [7])[0, 1, 0], told, rtol=1e-9)


def test_wave_that_runs_the_other_way_has_conjugate_rows():
    """Of a sector at k the conjugate rows with conjugate coordinates are the mirrored wave: same amplitudes."""
    group = small_basis().groups[0, 0]
    turned = replace(group, phi=group.phi * np.exp(0.7j))
    q = wave(2, group.n_modes)
    there = displacement(motion_of(500.0, q, turned), [3, 4])
    back = displacement(motion_of(500.0, q.conj(), turned, [True, True]), [3, 4])
    np.testing.assert_allclose(back, there.conj(), rtol=1e-12)


# ---------------------------------------------------------------- margins


def test_goodman_line():
    """Full strength at zero mean and in compression, none from R_m on; margins 2 at half of everything."""
    np.testing.assert_allclose(allowed_amplitude(LIMITS, [-5e8, 0, 450e6, 900e6, 2e9]), [300e6, 300e6, 150e6, 0, 0])
    found = vibration_margin(LIMITS, np.array([150e6, 0.0, 1.0]), np.array([0.0, 0, 1e9]))
    np.testing.assert_allclose(found, [2, np.inf, 0])
    np.testing.assert_allclose(proportional_margin(LIMITS, np.array([75e6, 0.0]), np.array([225e6, -1e6])), [2, np.inf])


def test_worst_place_of_a_sweep_and_what_is_left_out():
    group = small_basis((0.0, 3000.0)).groups[1, 0]
    motion = motion_of(np.full(5, 300.0), np.arange(1, 6)[:, None, None] * 1e-6 * wave(2, group.n_modes), group)
    found = worst(motion, LIMITS)
    each = [vibration_margin(LIMITS, c.amplitude, c.mean).min() for c in (cycle_stress(motion, i) for i in range(5))]
    assert found.vibration == pytest.approx(min(each), rel=1e-12)
    chosen = away_from(motion, found.point, 0.02)
    assert found.place not in chosen and worst(motion, LIMITS, only=chosen).vibration > found.vibration


@pytest.mark.parametrize("wrong", [{"fatigue_strength": 1e9}, {"yield_strength": 1e9}, {"tensile_strength": -1.0}])
def test_limits_that_contradict_each_other_are_refused(wrong):
    with pytest.raises(ValidationError):
        MaterialLimits(**{"fatigue_strength": 3e8, "tensile_strength": 9e8, **wrong})


def test_what_the_file_does_not_hold_is_said():
    group = replace(small_basis().groups[0, 0], stresses={}, phi=np.zeros((0, 3, 6)))
    motion = motion_of(1.0, np.zeros((2, group.n_modes)), group)
    refused("output.nodal_stress", cycle_stress, motion)
    refused("output.shapes", displacement, motion, 0)
    refused("no 'nose'; it has tip-probe", read_out, motion, "nose")
    refused("no such node", point_numbered, small_basis(), 10**6)
    refused("2 coordinates", motion_of, 1.0, np.zeros((2, 2)), group)


# ---------------------------------------------------------------- contacts over the cycle


def linear_patch(counts=(6, 2), normal=100.0, friction=0.3):
    """A patch of springs on the right side of the small beam, and its coordinates under a normal force."""
    import jax.numpy as jnp

    from microslip.contact.friction import Coulomb
    from microslip.contact.patch import Patch, equilibrium, grid
    from microslip.contact.point_laws import smooth_point
    from microslip.contact.series import ContactStiffness

    places, areas = grid(0.012, 0.004, counts)
    stiffness = ContactStiffness(1e7 / len(areas), (8e6 / len(areas),) * 2, "surface", "test")
    patch = Patch("right", places, areas, smooth_point(stiffness, Coulomb(jnp.asarray(friction, dtype=float))))
    return patch, equilibrium(patch, normal)


def marched_map(patch, side, u, samples=2048):
    """The map of a patch whose law is marched through the cycle of its coordinates, 0.01 s long."""
    from microslip.harmonic_balance.forces import traced
    from microslip.operating.contact_maps import contact_map

    force, c = traced(patch.law, patch.kinematics, u, 0.01, samples, 100)
    work = float(c.dissipated.sum())
    return contact_map(patch, side, np.asarray(force), c.taken, c.slipping, c.open, u.shape[1] // 2, work)


def test_contact_map_of_a_patch_that_slides_under_constant_load():
    """Full slip along t1: 4 mu F (A - mu F/k) a cycle, traction mu p, slips while A is gone through less 2 mu F/k.

    Samples: the reversal is hit exactly (a cosine), the loss is that of the parallelogram to 1e-3;
    the share of slip is met to a sample.
    """
    patch, u0 = linear_patch()
    force, k, mu, A = 100.0, 8e6, 0.3, 2e-5
    u = np.zeros((6, 3))
    u[:, 0], u[1, 1] = u0, A
    found = marched_map(patch, small_basis().groups[0, 0].interfaces["right"], u)
    assert found.normal_force == pytest.approx(force, rel=1e-9)
    np.testing.assert_allclose(found.pressure_most, found.pressure_least, rtol=1e-9)
    assert found.loss == pytest.approx(4 * mu * force * (A - mu * force / k), rel=1e-3)
    np.testing.assert_allclose(found.traction, mu * force / patch.areas.sum(), rtol=1e-6)
    stuck = np.arccos(1 - 2 * mu * force / k / A) / np.pi  # of each half cycle, from the reversal
    np.testing.assert_allclose(found.slipping, 1 - stuck, atol=2.5 / 2048)
    np.testing.assert_allclose(found.sticking + found.slipping + found.open, 1.0, atol=1e-12)
    assert found.by_samples < 0.02


def test_contact_map_of_a_patch_that_opens_at_one_edge():
    """Rocked about t2: points lift off for part of the cycle, the mean pressure is that of the clipped wave."""
    patch, u0 = linear_patch(normal=50.0)
    u = np.zeros((6, 3))
    u[:, 0], u[5, 1] = u0, 5e-3
    found = marched_map(patch, small_basis().groups[0, 0].interfaces["right"], u)
    y = patch.points[:, 0]
    k = 1e7 / patch.areas.sum()
    t = 2 * np.pi * np.arange(4096) / 4096
    told = k * np.maximum(u0[0] - 5e-3 * np.multiply.outer(np.cos(t), y), 0.0)
    np.testing.assert_allclose(found.pressure_mean, told.mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(found.pressure_most, told.max(axis=0), rtol=1e-6)
    np.testing.assert_allclose(found.open, (told == 0).mean(axis=0), atol=2e-3)
    assert found.open.max() > 0.3 and found.open[np.argmin(np.abs(y))] == 0


@pytest.mark.parametrize(("rocked", "said"), [(3e-6, ""), (5e-3, " as area opens\n")])
def test_where_nothing_slips_a_map_tells_no_work_of_samples(rocked: float, said: str) -> None:
    """Friction that holds all: what is lost is lost by area that opens, nowhere negative, and the work at 48 samples
    differs; where nothing opens, nothing is lost, and nothing is said of it."""
    from microslip.pictures.operating import _left

    patch, u0 = linear_patch((2, 2), normal=50.0, friction=5.0)
    u = np.zeros((6, 3))
    u[:, 0], u[5, 1], u[1, 1:] = u0, rocked, (1e-7, 2e-7)
    found = marched_map(patch, small_basis().groups[0, 0].interfaces["right"], u, 48)
    assert (found.dissipated >= 0).all() and (found.loss > 0) == bool(said)
    assert _left(found).startswith(said) and ("48 samples" in _left(found)) == bool(said) == (found.unbalanced != 0)


def test_tractions_of_a_contact_map_add_up_to_the_forces_of_its_group():
    """Also where the wave leads by a phase, at whose zero the samples begin: mean and first harmonic, 1e-12."""
    from microslip.harmonic_balance.forces import AFT
    from microslip.harmonic_balance.problem import Group
    from microslip.operating.contact_maps import contact_map

    patch, u0 = linear_patch((2, 2))
    zero, u = np.zeros((1, 6)), np.zeros((1, 6, 3))
    u[0, :, 0], u[0, 1, 1:], u[0, 2, 1:] = u0, (1.5e-5, 4e-6), (-3e-6, 1e-5)
    g = Group(AFT(patch, 1, 48, 100), np.arange(6)[None], None, zero, zero, np.array([0.7]), (0,))
    (F,), ((force, cycle),) = g.force(u, 0.01), g.traced(u, 0.01)
    side, what = small_basis().groups[0, 0].interfaces["right"], (cycle.taken, cycle.slipping, cycle.open)
    found = contact_map(patch, side, np.asarray(force), *what, 1, float(cycle.dissipated.sum()), 0.7)
    whole = -np.einsum("n,nah->ah", patch.areas, found.tractions)
    np.testing.assert_allclose(whole[:, 0], F[:3, 0], rtol=0, atol=1e-12 * np.abs(F).max())
    np.testing.assert_allclose(whole[:, 1], F[:3, 1] - 1j * F[:3, 2], rtol=0, atol=1e-12 * np.abs(F).max())
    assert found.loss == pytest.approx(g.point_cycles(u, 0.01)[0].lost.sum(), rel=1e-12) and found.loss > 1e-4


def test_contact_map_as_vtu(tmp_path):
    """Rectangles lie on the face and tile it; the mean traction on the body pushes it back, along minus its normal."""
    import meshio

    from microslip.operating.contact_maps import grid_of, on_grid, write_contact_vtu

    patch, u0 = linear_patch()
    side = small_basis().groups[0, 0].interfaces["right"]
    u = np.zeros((6, 3))
    u[:, 0], u[1, 1] = u0, 2e-5
    found = marched_map(patch, side, u)
    write_contact_vtu(found, tmp_path / "right.vtu")
    mesh = meshio.read(tmp_path / "right.vtu")
    quads = mesh.points[mesh.cells_dict["quad"]]
    assert np.ptp(quads[..., 0]) < 1e-9 and quads[0, 0, 0] == pytest.approx(side.origin[0])
    area = np.linalg.norm(np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0]), axis=1)
    np.testing.assert_allclose(area, patch.areas, rtol=1e-5)
    assert area.sum() == pytest.approx(0.012 * 0.004, rel=1e-5)
    push = mesh.cell_data["traction_mean"][0]
    np.testing.assert_allclose(push[:, 0], -100.0 / patch.areas.sum(), rtol=1e-5)
    swing = mesh.cell_data["traction_h1_real"][0]
    assert (np.abs(swing[:, 1]) > 10 * np.abs(swing[:, 2])).all()  # t1 is y on this side
    edges = grid_of(patch.points)
    assert edges is not None and len(edges[0]) == 7 and len(edges[1]) == 3
    assert on_grid(patch.points, patch.points[:, 0])[0, 0] == patch.points[:, 0].min()
    assert grid_of(np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.1]])) is None


# ---------------------------------------------------------------- files for ParaView


def test_operating_shape_as_vtu(tmp_path):
    """Fields come back; the instants are the wave at their angles, and add up to its mean."""
    import meshio

    from microslip.operating.shape import write_instants, write_shape_vtu

    basis = small_basis((0.0, 3000.0))
    group = basis.groups[1, 0]
    motion = motion_of(500.0, 1e-6 * wave(3, group.n_modes), group)
    write_shape_vtu(motion, basis, tmp_path / "shape.vtu", LIMITS)
    data = meshio.read(tmp_path / "shape.vtu").point_data
    a = displacement(motion, np.arange(basis.mesh.n_points))[0]
    np.testing.assert_allclose(data["h2_imag"], a[2].imag, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(data["amplitude"], longest(a[1]), rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(data["stress_amplitude"], cycle_stress(motion).amplitude, rtol=1e-5)
    assert data["margin"].min() == pytest.approx(worst(motion, LIMITS).vibration, rel=1e-5)
    write_instants(motion, basis, tmp_path / "cycle.pvd", 8)
    shots = [meshio.read(tmp_path / f"cycle_{d:03d}.vtu").point_data for d in range(0, 360, 45)]
    np.testing.assert_allclose(shots[2]["displacement"], at_time(a, np.pi / 2, axis=0), rtol=1e-4, atol=1e-10)
    mean = np.mean([s["displacement"] for s in shots], axis=0)
    np.testing.assert_allclose(mean, a[0].real, atol=1e-5 * np.abs(a).max())
    assert (tmp_path / "cycle.pvd").read_text().count("<DataSet") == 8


def test_wave_on_a_ring(tmp_path):
    """Sector j lags or leads by j k 2 pi / N, turned; all sectors have one amplitude; conjugate rows turn it round."""
    import meshio

    from microslip.operating.shape import on_sector, write_ring_vtu

    basis = small_basis()
    group = replace(basis.groups[0, 0], harmonic=2, phi=basis.groups[0, 0].phi * np.exp(0.3j))
    ring = replace(basis, sectors=5, groups={(0, 2): group}, rotation_point=np.array([0.0, 0.0, -0.2]))
    q = 1e-6 * wave(2, group.n_modes)
    for turned, sign in ((False, 1), (True, -1)):
        motion = motion_of(500.0, q, group, [turned] * 2)
        a, b = on_sector(motion, ring, 0), on_sector(motion, ring, 3)
        angle = 2 * np.pi * 3 / 5  # about y: z goes towards x
        R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
        np.testing.assert_allclose(b[1], np.exp(sign * 2j * np.pi * 6 / 5) * a[1] @ R.T, atol=1e-15)
    write_ring_vtu(motion, ring, tmp_path / "ring.vtu")
    data = meshio.read(tmp_path / "ring.vtu").point_data
    n = basis.mesh.n_points
    np.testing.assert_allclose(data["amplitude"][:n], data["amplitude"][3 * n : 4 * n], rtol=1e-5)
    refused("not cyclic", on_sector, motion, basis, 1)
