"""What every reduction method carries: strain, stress, gauges, static stress, interface rows, residual stresses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from meshes import STEEL, body, brick
from rings import bladed_sector
from test_reduction import LOOK, PUSH, SIDE, STATICALLY_EXACT, TIP, full_model, static_answer

from microslip.basis import check_basis, read_basis, write_basis
from microslip.basis.strains import single
from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise
from microslip.fem.operators import displacement_gradient, green_strain
from microslip.modal.body_rows import body_rows
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.reduction import METHODS

MESH = brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05))
GAUGE = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
FORCE = np.array([2.0, -1.0, 0.5, 0.01, 0.02, -0.03])


def first_place():
    """The first integration point of the mesh, where the gauge sits."""
    (b,) = discretise(MESH).blocks
    return b.N[0] @ MESH.points[b.cells[0]]


def settings(method: str, **more):
    """A block on two contacts; its gauge sits inside, where strain is known at an integration point."""
    return body(**{
        "supports": [{"face": "x0"}], "interfaces": [TIP, SIDE], "excitations": [PUSH], "monitors": [LOOK],
        "gauges": [{"name": "root", "point": first_place().tolist(), "direction": GAUGE.tolist()}],
        "modes": {"count": 6}, "reduction": method, "output": {"gauss": True, "nodal_stress": True}, **more,
    })  # fmt: skip


@cache
def basis(method: str, rpm: float = 0.0):
    turning = {"speeds_rpm": [rpm], "axis": [0.0, 1.0, 0.0], "point": [-0.2, 0, 0]}
    return modal_basis(MESH, settings(method, rotation=turning))


def strain_of(u):
    """(s, 6) strain at the integration points of a displacement (n, 3)."""
    (b,) = discretise(MESH).blocks
    return green_strain(displacement_gradient(b, u), nonlinear=False).reshape(-1, 6)


def stretch(strain):
    """Along the gauge, from six components with engineering shear."""
    xx, yy, zz, xy, yz, xz = strain
    E = np.array([[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, zz]])
    return GAUGE @ E @ GAUGE


@pytest.mark.parametrize("method", list(METHODS))
def test_rows_of_every_coordinate_read_its_shape(method):
    """Interface rows, monitor, gauge, strain and stress per coordinate, from phi by other means; at rest."""
    g = basis(method).groups[0, 0]
    C = isotropic(STEEL["young"], STEEL["poisson"])
    patches = body_rows(MESH, settings(method)).patches
    for name, item in g.interfaces.items():
        want = patches[name].B @ g.phi.reshape(-1, g.n_modes)
        np.testing.assert_allclose(item.rows, want, atol=1e-12 * np.abs(want).max())
    assert g.kind and g.stresses["gauss"].stress.shape[2] == g.n_modes
    for j in range(g.n_modes):
        strain = strain_of(g.phi[:, :, j])
        top = np.abs(strain).max()
        np.testing.assert_allclose(g.stresses["gauss"].strain[:, :, j], strain, atol=1e-12 * top)
        stress = strain @ C.T
        np.testing.assert_allclose(g.stresses["gauss"].stress[:, :, j], stress, atol=1e-12 * np.abs(stress).max())
        assert g.gauges["root"].rows[0, j] == pytest.approx(stretch(strain[0]), abs=1e-9 * top)


@pytest.mark.parametrize(
    ("method", "where"), [*((m, "tip") for m in (*STATICALLY_EXACT, "macneal")), ("rubin", "push"), ("macneal", "push")]
)
def test_static_answers_are_whole_in_every_row(method, where):
    """A force on a contact, or the load: displacement, strain, stress, gauge equal the full model's (1e-8, stocky).

    MacNeal adds what stands beside the modes: residual shapes and stresses times the forces. Craig-Bampton, dual and
    massless bases promise no more than the contacts.
    """
    made = settings(method)
    g = basis(method).groups[0, 0]
    pencil, K, _, B = full_model(MESH, made)
    free = np.setdiff1d(np.arange(3 * MESH.n_points), fixed_dofs(MESH, made))
    load = body_rows(MESH, made).excitations["push"].B.toarray()[:, free]
    force, rows = (FORCE, B[:6]) if where == "tip" else (np.array([3.0]), load)
    u = np.zeros(3 * MESH.n_points)
    u[free] = np.linalg.solve(K, rows.T @ force)
    u = u.reshape(-1, 3)
    q = static_answer(g, "tip", force) if where == "tip" else np.linalg.solve(g.K_r, g.excitations["push"].rows[0] * 3)
    strain = strain_of(u)
    stress = strain @ isotropic(STEEL["young"], STEEL["poisson"]).T
    found = {
        "phi": g.phi @ q, "strain": g.stresses["gauss"].strain @ q, "stress": g.stresses["gauss"].stress @ q,
        "gauge": g.gauges["root"].rows @ q,
    }  # fmt: skip
    if method == "macneal":
        r = g.residual
        f = np.zeros(len(r.labels))
        f[[i for i, label in enumerate(r.labels) if where in label.split(":")]] = force
        gauss = (r.phi @ f, r.strain["gauss"] @ f, r.stress["gauss"] @ f, r.gauges["root"] @ f)
        found = {k: v + more for (k, v), more in zip(found.items(), gauss, strict=True)}
    for key, want in (("phi", u), ("strain", strain), ("stress", stress), ("gauge", stretch(strain[0]))):
        np.testing.assert_allclose(found[key], want, atol=1e-8 * np.abs(want).max(), err_msg=key)


def test_without_residual_stresses_modes_alone_miss_most_of_a_contact_force():
    """Six eigenmodes leave more than a tenth of the largest stress out: what `residual` is for."""
    g = basis("macneal").groups[0, 0]
    q = static_answer(g, "tip", FORCE)
    f = np.zeros(len(g.residual.labels))
    f[:6] = FORCE
    modes, rest = (np.abs(s).max() for s in (g.stresses["gauss"].stress @ q, g.residual.stress["gauss"] @ f))
    assert rest > 0.1 * modes


@pytest.mark.parametrize("method", list(METHODS))
def test_static_state_does_not_depend_on_the_method(method):
    """At 3000 rpm: displacement, Cauchy stress at Gauss points and nodes, strain of the gauge."""
    a, b = basis("eigenmodes", 3000.0).groups[0, 0], basis(method, 3000.0).groups[0, 0]
    np.testing.assert_array_equal(a.u_static, b.u_static)
    assert a.gauges["root"].static[0] == b.gauges["root"].static[0] != 0
    for name in ("gauss", "nodes"):
        assert np.abs(b.stresses[name].static_stress).max() > 1e5
        np.testing.assert_array_equal(a.stresses[name].static_stress, b.stresses[name].static_stress)


@pytest.mark.parametrize("rpm", [0.0, 3000.0])
def test_residual_stresses_travel_through_the_file(rpm, tmp_path):
    made = basis("macneal", rpm)
    write_basis(tmp_path / "b.h5", made)
    back = read_basis(tmp_path / "b.h5")
    findings = check_basis(back)
    assert [c.name for c in findings if not c.passed] == []
    assert any("residual shapes" in c.name for c in findings)
    a, b = made.groups[0, 0].residual, back.groups[0, 0].residual
    assert a.labels == b.labels and len(a.labels) == 13
    np.testing.assert_array_equal(a.phi, b.phi)
    np.testing.assert_array_equal(a.gauges["root"], b.gauges["root"])
    for name in ("gauss", "nodes"):
        np.testing.assert_array_equal(single(a.strain[name]), b.strain[name])
        np.testing.assert_array_equal(single(a.stress[name]), b.stress[name])
    assert basis("rubin", rpm).groups[0, 0].residual is None
    xarray = pytest.importorskip("xarray")
    with xarray.open_datatree(tmp_path / "b.h5", engine="h5netcdf", phony_dims="sort") as tree:
        assert tree["speed_0/nd_0/residual/stress/gauss/T"].dims == ("place", "component", "force")
        assert tree["speed_0/nd_0/residual/gauge/root/T"].dims == ("row", "force")


def test_residual_shapes_read_the_residual_compliance():
    """The rows of what stands beside are static minus modal compliance, of forces on interfaces and loads."""
    g = basis("macneal").groups[0, 0]
    patches = body_rows(MESH, settings("macneal")).patches
    at = [g.compliance.labels.index(label) for label in g.residual.labels]
    read = np.vstack([patches[n].B @ g.residual.phi.reshape(-1, len(at)) for n in ("tip", "side")])
    want = g.compliance.residual[np.ix_(at[:12], at)]
    scale = np.sqrt(np.outer(np.diag(g.compliance.static)[at[:12]], np.diag(g.compliance.static)[at]))
    assert np.abs((read - want) / scale).max() < 1e-9


def test_a_free_body_and_a_sector_keep_residual_shapes_too(tmp_path):
    """With inertia relief; complex at a nodal diameter. Both pass the checks of their files."""
    free = modal_basis(MESH, settings("macneal", supports=[], free=True, modes={"count": 10}))
    assert free.groups[0, 0].residual.phi.shape[2] == 13
    ring = modal_basis(bladed_sector(), body(
        supports=[{"face": "bore"}], interfaces=[{"name": "right", "face": "contact_right"}], modes={"count": 4},
        cyclic={"sectors": 6, "nodal_diameters": [0, 1]}, reduction="macneal",
    ))  # fmt: skip
    for name, made in (("free", free), ("ring", ring)):
        write_basis(tmp_path / f"{name}.h5", made)
        findings = check_basis(read_basis(tmp_path / f"{name}.h5"))
        assert [c.name for c in findings if not c.passed] == []
    inner = next(g for (_, k), g in read_basis(tmp_path / "ring.h5").groups.items() if 0 < k < ring.sectors / 2)
    assert np.iscomplexobj(inner.residual.phi) and inner.residual.phi.shape[2] == 6
