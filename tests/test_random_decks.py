"""Decks at random: two parts of random cells, placed and turned, tied, held, with an equation, against CalculiX, which
gets them flattened by hand, the tie as equations: its own ties of triangles are up to 4e-5 of a frequency away."""

from __future__ import annotations

import decks
import instanced
import meshes
import numpy as np
import pytest
from instanced import Placed
from test_tied import modes

SETS = ("z0", "z1", "x1")
CELLS = ("hexahedron20", "wedge15", "tetra10")
SOFT = ["*MATERIAL, NAME=Soft", "*ELASTIC", "70000., 0.33", "*DENSITY", "2.7e-9"]


def tied(slave, master, shift):
    """Lines of *EQUATION by which points of z0 lie in the faces of z1, the master being the first in its deck."""
    own, lines = master.points, []
    for point in slave.face_points("z0"):
        at = slave.points[point] + np.array(shift) / 1e3
        nodes, share = next(found for f in master.faces["z1"].values() for c in f for found in inside(c, own, at))
        assert np.abs(share @ own[nodes] - at).max() < 1e-12
        terms = [(master.n_points + point + 1, -1.0), *((n + 1, w) for n, w in zip(nodes, share, strict=True))]
        for i in (1, 2, 3):
            lines += ["*EQUATION", str(len(terms)), *(f"{n}, {i}, {w!r}" for n, w in terms)]
    return lines


def inside(cell, points, at):
    """The face's points and their shares, if the place is in it."""
    count = 3 if len(cell) == 6 else 4
    a, b, c = points[cell[[0, 1, count - 1]], :2]
    x, y = np.linalg.solve(np.column_stack([b - a, c - a]), at[:2] - a)
    if min(x, y) < -1e-9 or (max(x, y) > 1 + 1e-9 if count == 4 else x + y > 1 + 1e-9):
        return
    if count == 3:
        one = np.array([1 - x - y, x, y])
        yield cell, [float(v) for v in (*one * (2 * one - 1), *4 * one * np.roll(one, -1))]
        return
    u, v = 2 * x - 1, 2 * y - 1
    corners = [(1 + s * u) * (1 + t * v) * (s * u + t * v - 1) / 4 for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    middles = [(1 - u * u) * (1 - v), (1 + u) * (1 - v * v), (1 - u * u) * (1 + v), (1 - u) * (1 - v * v)]
    yield cell, [float(v) for v in (*corners, *np.array(middles) / 2)]


@pytest.mark.slow
@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
@pytest.mark.parametrize("seed", (1, 6, 9, 11, 14, 27, 28))
def test_random_decks_have_the_modes_of_calculix(tmp_path, monkeypatch, seed):
    rng = np.random.default_rng(seed)
    low, up = rng.uniform((14, 14, 20), (24, 24, 40)).round(1), rng.uniform((8, 8, 15), (13, 13, 40)).round(1)
    own = {
        name: meshes.brick(str(rng.choice(CELLS)), tuple(map(int, rng.integers(2, 4, 3))), tuple(size / 1e3))
        for name, size in (("Lower", low), ("Upper", up))
    }
    axis, angle = rng.normal(size=3).round(2), round(rng.uniform(-170, 170), 1)
    beside = (*rng.uniform(0, low[:2] - up[:2]).round(2), low[2])
    turned = {"a": (1.0, 2.0, 3.0), "b": tuple(map(float, axis + (1, 2, 3))), "angle": angle}
    placed = [Placed("L", "Lower", **turned), Placed("U", "Upper", tuple(map(float, beside)), **turned)]
    side, *ends = map(own["Lower"].face_points, ("x1", "z0", "z1"))
    between = np.setdiff1d(side, np.concatenate(ends))
    one, two, three = (int(own["Lower"].node_id[i]) for i in rng.choice(between, 3, replace=False))
    a, b = rng.uniform(-1.0, 1.0, 2).round(3)
    terms = [(one, 1, 1.0), (two, 2, a), (three, 3, b)]
    equation = ["*EQUATION", "3", ", ".join(f"{{L}}{n}, {i}, {v}" for n, i, v in terms)]
    materials = [*decks.MATERIAL, *SOFT]

    parts = {n: instanced.part_lines(n, m, SETS, s) for (n, m), s in zip(own.items(), ("Steel", "Soft"), strict=True)}
    tie = ["*Tie, name=Glue, adjust=yes, position tolerance=0.1", "U.S-z0, L.S-z1"]
    inside = [*tie, *(line.replace("{L}", "L.") for line in equation)]
    deck = instanced.instanced(parts, placed, inside, [*materials, "*BOUNDARY", "L.z0, 1, 3"])
    flat, first = instanced.flattened(own, placed, SETS)
    flat += [*materials, decks.section("E_L"), decks.section("E_U", "Soft"), "*BOUNDARY", "L_z0, 1, 3"]
    assert first["L"] == 0
    flat += tied(own["Upper"], own["Lower"], beside)
    flat += [line.replace("{L}", "") for line in equation]
    there = decks.run(tmp_path, "ccx", [*flat, *decks.frequency_step(8)])
    np.testing.assert_allclose(modes(tmp_path, "two", deck, monkeypatch)[:8], there[:8], rtol=1e-6)
