"""Mechanisms: motions that no stiffness resists are refused by name, however rounding makes them look."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import body, brick
from touching import together

from microslip.data import Mesh
from microslip.errors import UserError
from microslip.modal.compute import modal_basis

JOINT = {"name": "joint", "face": "b_z0", "against": "a_z1"}
BOLT = {"name": "m8", "face": "b_z1", "against": "a_z0", "preload": 5e4}
BELOW = {"face": "a_z0", "directions": "z"}


def sides(*parts: str) -> list[dict]:
    return [{"face": f"{p}_{s}0", "directions": s} for p in parts for s in "xy"]


def plates() -> Mesh:
    """A plate b on a plate a, touching and sharing no points."""
    lower = brick("tetra10", (2, 2, 1), (0.1, 0.1, 0.02))
    return together(a=lower, b=brick("hexahedron20", (3, 3, 1), (0.1, 0.1, 0.02), (0, 0, 0.02)))


def told(mesh: Mesh, **table) -> str:
    with pytest.raises(UserError) as error:
        modal_basis(mesh, body(modes={"count": 3}, **table))
    return str(error.value)


PRESSURE = {"kind": "pressure", "face": "b_z1", "value": 1e5}


@pytest.mark.parametrize("pressed", [{"bolts": [BOLT]}, {"loads": [PRESSURE]}])
def test_a_part_that_only_an_open_contact_holds_is_refused(pressed):
    """Its stiffness along z is zero; rounding made of it 0.0015 Hz (bolt) or a negative eigenvalue (pressure)."""
    text = told(plates(), supports=[*sides("a", "b"), BELOW], closures=[{**JOINT, "modes": "open"}], **pressed)
    assert text.startswith("closures: nothing that counts in the modes holds the part with faces 'b_x0'")
    assert "against translation along z" in text


def test_a_closed_contact_holds_along_its_normal_and_lets_slide():
    closed = [{**JOINT, "modes": "closed"}]
    held = body(supports=[*sides("a", "b"), BELOW], closures=closed, bolts=[BOLT], modes={"count": 3})
    assert modal_basis(plates(), held).groups[0, 0].frequency[0] > 1000
    sliding = [*sides("a"), BELOW, {"face": "b_x0", "directions": "x"}]
    text = told(plates(), supports=sliding, closures=closed, bolts=[BOLT])
    assert "'b_x0'" in text and "against translation along y" in text


def test_parts_without_a_contact_are_refused_before_anything_is_solved():
    assert "against translation along z" in told(plates(), supports=[*sides("a", "b"), BELOW])
    assert "nothing holds the part with faces 'b_x0'" in told(plates(), supports=[{"face": "a_z0"}])
    assert "falls into 2 parts" in told(plates(), free=True)


def test_two_parts_that_are_both_held_are_two_bodies_in_one_file():
    """Nothing joins them and nothing is missing: the frequencies of both, sorted."""
    both = body(supports=[{"face": "a_z0"}, {"face": "b_z1"}], modes={"count": 4})
    found = modal_basis(plates(), both).groups[0, 0].frequency
    lower, upper = brick("tetra10", (2, 2, 1), (0.1, 0.1, 0.02)), brick("hexahedron20", (3, 3, 1), (0.1, 0.1, 0.02))
    alone = [
        modal_basis(mesh, body(supports=[{"face": face}], modes={"count": 4})).groups[0, 0].frequency
        for mesh, face in ((lower, "z0"), (upper, "z1"))
    ]
    np.testing.assert_allclose(found[:4], np.sort(np.concatenate(alone))[:4], rtol=1e-8)


def hinged() -> Mesh:
    """Two blocks that share the points of one edge: a hinge about y."""
    a = brick("hexahedron20", (2, 2, 2), (0.1, 0.06, 0.04))
    b = brick("hexahedron20", (2, 2, 2), (0.1, 0.06, 0.04), (0.1, 0, 0.04))
    both = together(a=a, b=b)
    _, first, number = np.unique(np.round(both.points, 9), axis=0, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    cells = {t: number[c] for t, c in both.cells.items()}
    faces = {n: {t: number[f] for t, f in v.items()} for n, v in both.faces.items()}
    return Mesh(both.points[first], cells, faces, {}, np.arange(1, len(first) + 1))


def test_a_block_hinged_on_an_edge_is_refused_though_its_points_are_joined():
    assert "by a point or an edge only" in told(hinged(), supports=[{"face": "a_x0"}])
    held = body(supports=[{"face": "a_x0"}, {"face": "b_z1", "directions": "z"}], modes={"count": 3})
    assert modal_basis(hinged(), held).groups[0, 0].frequency[0] > 100
