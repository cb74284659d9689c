"""Faces that meet: frames of bodies that stand turned, faces that do not meet, points cut at an outline."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from small import basis

from microslip.contact.patch import grid
from microslip.data import Array, Interface
from microslip.frames import rotation
from microslip.system.pairing import Place, facing, in_ring, rigid_points

Y = np.array([0.0, 1.0, 0.0])


def face(normal: Array, t2: Array, origin: Array, extent=(0.04, 0.006), outline: Array | None = None) -> Interface:
    """A flat patch by hand."""
    n = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    t2 = np.asarray(t2, dtype=float) - n * (n @ t2)
    t2 /= np.linalg.norm(t2)
    R = np.array([n, np.cross(t2, n), t2])
    b, h = extent
    flat = np.array([[-b, -h], [b, -h], [b, h], [-b, h]]) / 2 if outline is None else outline
    origin = np.asarray(origin, dtype=float)
    rows, empty = np.zeros((6, 0)), np.zeros((0, 3))
    polygon = origin + flat @ R[1:]
    return Interface(origin, R, rows, np.zeros(0), empty, np.zeros(0), empty, np.zeros((0, 3, 0)),
                     extent=np.array(extent), polygon=polygon)  # fmt: skip


def moved(interface: Interface, turn: Array, shift: Array) -> Interface:
    """The same face, drawn in the axes of a body from which it stands at turn x + shift: x' = turn^T (x - shift)."""
    back = turn.T
    return replace(interface, origin=back @ (interface.origin - shift), rotation=interface.rotation @ turn,
                   polygon=(interface.polygon - shift) @ turn)  # fmt: skip


def test_rigid_motion_of_both_bodies_together_is_no_relative_motion() -> None:
    """Both faces ride on one rigid motion of space: six rows of the first equal those of the second in its frame,
    wherever the second body's axes are and whatever part of the face its own covers: 1e-12 of the motion."""
    rng = np.random.default_rng(2)
    first = face([1, 0.3, 0.2], [0, 0, 1], [0.05, 0.01, 0.4])
    n, t1, t2 = first.rotation
    beside = face(-n, t2 + 0.3 * t1, first.origin + 0.006 * t1 - 0.001 * t2)
    turn, shift = rotation(rng.normal(size=3), 0.7), rng.normal(size=3)
    second = moved(beside, turn, shift)
    met = facing(first, second, Place(turn, shift))
    move, spin = rng.normal(size=3), rng.normal(size=3)

    def six(f: Interface) -> Array:  # of a face in common axes
        place = move + np.cross(spin, f.origin)
        return np.concatenate([f.rotation @ place, f.rotation @ spin])

    np.testing.assert_allclose(met.frame @ six(beside), six(first), rtol=0, atol=1e-12)
    np.testing.assert_allclose(met.offset, [0.006, -0.001], rtol=0, atol=1e-15)
    assert abs(met.gap) < 1e-15 and not met.messages


def test_gap_is_measured_along_the_first_normal() -> None:
    first = face([1, 0, 0], [0, 0, 1], [0, 0, 0])
    assert facing(first, face([-1, 0, 0], [0, 0, 1], [2e-4, 0, 0])).gap == pytest.approx(2e-4, rel=1e-14)
    near = facing(first, face([-1, 0, 0], [0, 0, 1], [-2e-5, 0, 0]))
    assert near.gap == pytest.approx(-2e-5, rel=1e-14) and not near.messages
    for x, words in ((1e-3, "1 mm apart"), (-1e-3, "1 mm inside each other")):
        assert words in facing(first, face([-1, 0, 0], [0, 0, 1], [x, 0, 0])).messages[0]


def test_neighbours_of_a_cyclic_sector_meet_as_their_image() -> None:
    """A face and its image in the sector before: met turned, with no gap, angle or offset left (1e-12 m, rad)."""
    N = 24
    right = face([1, 0.4, 0.1], [0, 0, 1], [0.05, 0.02, 0.4])
    back = rotation(Y, -2 * np.pi / N)
    n, _, t2 = right.rotation
    left = face(-(back @ n), back @ t2, back @ right.origin)
    met = in_ring(right, left, Y, np.zeros(3), N, ("right", "left"))
    assert not met.messages
    assert max(abs(met.gap), met.angle, *np.abs(met.offset)) < 1e-12
    behind = in_ring(left, right, Y, np.zeros(3), N, ("left", "right"), sector=-1)
    np.testing.assert_allclose(behind.frame @ met.frame, np.eye(6), rtol=0, atol=1e-12)


def test_flat_faces_of_single_blades_use_their_own_frames() -> None:
    """The test blade of section 5.3, normals +-x: 24 of them miss by 15 degrees, so its own frames are used."""
    right, left = face([1, 0, 0], [0, 0, 1], [0.044, 0, 0.4775]), face([-1, 0, 0], [0, 0, 1], [-0.044, 0, 0.4775])
    met = in_ring(right, left, Y, np.zeros(3), 24, ("blade:right", "blade:left"))
    assert math.isnan(met.gap) and "own contact frame" in met.messages[0]
    np.testing.assert_array_equal(met.frame, np.diag([-1.0, -1, 1, -1, -1, 1]))
    many = in_ring(right, left, Y, np.zeros(3), 300, ("blade:right", "blade:left"))  # 1.2 degrees, but 78 mm inside
    assert math.isnan(many.gap)


def test_places_are_seen_from_each_other() -> None:
    """x = turn x' + shift of two bodies and a further turn: the same point by either way, 1e-12."""
    rng = np.random.default_rng(5)
    a, b = (Place(rotation(rng.normal(size=3), 1.1), rng.normal(size=3)) for _ in range(2))
    x, about, R = rng.normal(size=3), rng.normal(size=3), rotation(Y, 0.4)
    there = b.turn @ x + b.shift
    seen = b.seen_from(a)
    np.testing.assert_allclose(a.turn @ (seen.turn @ x + seen.shift) + a.shift, there, rtol=0, atol=1e-12)
    on = b.then(R, about)
    np.testing.assert_allclose(on.turn @ x + on.shift, R @ (there - about) + about, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (face([-1, 0.3, 0], [0, 0, 1], [0, 0, 0]), "16.7 degrees"),
        (face([1, 0, 0], [0, 0, 1], [0, 0, 0]), "180 degrees"),
        (face([-1, 0, 0], [0, 0, 1], [0, 0.03, 0]), "30 mm apart"),
        (face([-1, 0, 0], [0, 0, 1], [0.3, 0, 0]), "300 mm apart along the normal"),
        (face([-1, 0, 0], [0, 0, 1], [-0.05, 0, 0]), "50 mm inside each other"),
    ],
)
def test_faces_that_do_not_meet_are_named_in_one_sentence(second: Interface, words: str) -> None:
    first = face([1, 0, 0], [0, 0, 1], [0, 0, 0])
    named = ("'a:right' and 'b:left' do not face each other", words)
    assert refused(named, facing, first, second, names=("a:right", "b:left")).count(". ") == 0


def test_a_ring_of_faces_that_never_meet_is_refused() -> None:
    right = face([1, 0, 0], [0, 0, 1], [0.044, 0, 0.4])
    for left in (face([-1, 1, 0], [0, 0, 1], [-0.044, 0, 0.4]), face([-1, 0, 0], [0, 1, 0], [-0.044, 0, 0.4]),
                 face([-1, 0, 0], [0, 0, 1], [-0.044, 0, 0.2])):  # fmt: skip
        words = ("turned by 15 degrees", "blade:left", "number of blades")
        refused(words, in_ring, right, left, Y, np.zeros(3), 24, ("blade:right", "blade:left"))


def test_a_slight_angle_is_told() -> None:
    first = face([1, 0, 0], [0, 0, 1], [0, 0, 0])
    met = facing(first, face([-1, 0.02, 0], [0, 0, 1], [0, 0, 0]))
    assert met.angle == pytest.approx(math.atan(0.02), rel=1e-12) and "1.1 degrees" in met.messages[0]


def test_points_are_cut_at_the_outline() -> None:
    """Area and first moments of a hexagon to rounding, second moments of order 1/n^2; none lies outside."""
    angle = np.arange(6) * np.pi / 3 + 0.2
    outline = 0.01 * np.column_stack([np.cos(angle), 0.5 * np.sin(angle)])
    patch = face([0.2, 1, 0.1], [0, 0, 1], [0.1, 0.2, 0.3], extent=tuple(np.ptp(outline, axis=0)), outline=outline)
    area, second = 1.5 * math.sqrt(3) * 0.5e-4, []
    for n in (6, 12, 24, 48):
        points, areas = rigid_points(patch, (n, n))
        assert areas.sum() == pytest.approx(area, rel=1e-12)
        np.testing.assert_allclose(areas @ points / area, 0, atol=1e-14)
        assert len(areas) < n * n
        for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            e, r = b - a, points - a
            assert (e[0] * r[:, 1] - e[1] * r[:, 0] > 0).all()
        second.append(areas @ points[:, 0] ** 2)
    exact = 5 * math.sqrt(3) / 16 * 0.5 * 1e-8  # of a regular hexagon about any axis, squeezed by 1/2 along the other
    errors = np.abs(np.array(second) / exact - 1)
    order = np.polyfit(np.log([6, 12, 24, 48]), np.log(errors), 1)[0]
    assert order == pytest.approx(-2, abs=0.1)


def test_slivers_join_their_neighbours() -> None:
    """A parallelogram whose sides pass a corner of the rectangles by a hair: no point carries less than a tenth of one;
    area (and with it the stiffness, which goes by area) and first moments stay to rounding, as without joining."""
    b, h, slant = 0.016, 0.05, 0.0081
    outline = np.array([[-b, -h], [b, -h + slant], [b, h], [-b, h - slant]]) / 2
    patch = face([1, 0, 0], [0, 0, 1], [0, 0, 0], extent=tuple(np.ptp(outline, axis=0)), outline=outline)
    area = b * (h - slant / 2 * 1)
    for counts in ((2, 8), (3, 25), (8, 2)):
        points, areas = rigid_points(patch, counts)
        assert areas.min() > 0.1 * b * h / np.prod(counts)
        assert areas.sum() == pytest.approx(area, rel=1e-12)
        np.testing.assert_allclose(areas @ points / area, 0, atol=1e-15)
    triangle = np.array([[0.0, 0.0], [1e-2, 0.0], [1e-2, 1e-2]])
    patch = face([1, 0, 0], [0, 0, 1], [0, 0, 0], extent=(1e-2, 1e-2), outline=triangle)
    points, areas = rigid_points(patch, (1, 1))
    assert areas.tolist() == pytest.approx([0.5e-4])


def test_a_rectangle_is_the_books_grid() -> None:
    points, areas = rigid_points(face([1, 0, 0], [0, 0, 1], [0, 0, 0], (0.072, 0.005)), (12, 3))
    centres, each = grid(0.072, 0.005, (12, 3))
    np.testing.assert_allclose(points, centres, rtol=0, atol=1e-16)
    np.testing.assert_allclose(areas, each, rtol=1e-12)


def test_the_interfaces_own_points_fill_its_face() -> None:
    """Area and middle of the face of a meshed body, in its frame: 1e-12."""
    found = basis().groups[0, 0].interfaces["right"]
    points, areas = rigid_points(found)
    assert areas.sum() == pytest.approx(np.prod(found.extent), rel=1e-12)
    np.testing.assert_allclose(areas @ points, 0, atol=1e-18)
    assert (np.abs(points) < found.extent / 2).all()
