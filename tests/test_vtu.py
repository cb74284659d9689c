"""VTU for ParaView: read back with meshio and compared with the basis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import small

from microslip.exchange.vtu import write_vtu

meshio = pytest.importorskip("meshio")


def test_a_basis_comes_back(tmp_path: Path) -> None:
    basis = small.basis()
    write_vtu(basis, tmp_path / "b.vtu")
    back, group = meshio.read(tmp_path / "b.vtu"), basis.groups[0, 0]
    np.testing.assert_array_equal(back.points, basis.mesh.points)
    np.testing.assert_array_equal(back.cells_dict["tetra10"], basis.mesh.cells["tetra10"])
    for j, f in enumerate(group.frequency):
        np.testing.assert_allclose(
            back.point_data[f"mode_{j + 1:02d}_{f:.2f}Hz"], group.phi[:, :, j], rtol=1e-6, atol=1e-7
        )
        wanted = group.stresses["nodes"].stress[:, :, j]
        found = back.point_data[f"stress_{j + 1:02d}_{f:.2f}Hz"]
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
    assert np.flatnonzero(back.point_data["face_clamp"]).tolist() == basis.mesh.face_points("clamp").tolist()
    assert back.point_data["node"].tolist() == basis.mesh.node_id.tolist()
    assert not [n for n in back.point_data if "static" in n]


def test_several_speeds_stand_beside_each_other_with_their_static_state(tmp_path: Path) -> None:
    basis = small.basis((0.0, 3000.0))
    write_vtu(basis, tmp_path / "b.vtu")
    data, group = meshio.read(tmp_path / "b.vtu").point_data, basis.groups[1, 0]
    np.testing.assert_allclose(data["3000rpm_u_static"], group.u_static, rtol=1e-6, atol=1e-12)
    wanted = group.stresses["nodes"].static_stress
    np.testing.assert_allclose(data["3000rpm_stress_static"], wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
    assert f"0rpm_mode_01_{basis.groups[0, 0].frequency[0]:.2f}Hz" in data
    assert "0rpm_u_static" not in data


def test_rigid_modes_are_named_so(tmp_path: Path) -> None:
    write_vtu(small.basis(free=True), tmp_path / "b.vtu")
    assert "mode_06_rigid" in meshio.read(tmp_path / "b.vtu").point_data
