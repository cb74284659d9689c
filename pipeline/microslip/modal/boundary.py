"""Supports and dead loads of a body file on its mesh, and the refusal of bodies that nothing holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Array, Indices, Material, Mesh
from ..errors import UserError
from ..fem.discretise import Discretisation, face_blocks
from ..fem.loads import body_force, pressure, traction
from ..settings.body import BodySettings, MaterialSettings
from . import rigid
from .equilibrium import BodyModel
from .rows import Locator

AXES = {"x": 0, "y": 1, "z": 2}


def require_face(mesh: Mesh, face: str, key: str, points_suffice: bool = False) -> None:
    if face in mesh.faces or (points_suffice and face in mesh.point_sets):
        return
    if face in mesh.inner:
        inside, count = mesh.inner[face]
        raise UserError(
            f"{key}: {inside} of {count} facets of the set '{face}' are not on the surface of the volume mesh; "
            "choose another face, or mesh volume and surface together"
        )
    known = sorted(mesh.faces) + (sorted(set(mesh.point_sets) - set(mesh.faces)) if points_suffice else [])
    raise UserError(f"{key}: the mesh has no face '{face}'; its faces are {', '.join(known) or 'none'}")


def fixed_dofs(mesh: Mesh, settings: BodySettings) -> Indices:
    """Held degrees of freedom: 3 * point + component, and behind those of the points six of each reference node."""
    fixed = [np.zeros(0, dtype=np.int64)]
    for support in settings.supports:
        nodes = np.zeros(0, dtype=np.int64)
        moves = mesh.ties.sets.get(support.face, nodes) if mesh.ties is not None else nodes
        if not len(moves) or support.face in {*mesh.faces, *mesh.point_sets}:
            require_face(mesh, support.face, f"supports.{support.face}.face", points_suffice=True)
            nodes = mesh.set_points(support.face)
        fixed += [3 * nodes + AXES[c] for c in support.directions]
        ways = [AXES[c] for c in support.directions] + support.turns
        fixed += [3 * mesh.n_points + 6 * moves + way for way in ways]
    return np.unique(np.concatenate(fixed))


def materials_of(d: Discretisation, settings: BodySettings) -> list[Material]:
    """The material of each block: that of the settings, or those the mesh file brings.

    Raises:
        UserError: the mesh file brings none.
    """
    known = known_materials(d.mesh, settings)
    return [known[b.region if len(known) > 1 else 0] for b in d.blocks]


def known_materials(mesh: Mesh, settings: BodySettings) -> tuple[Material, ...]:
    """The one of the settings, or those the mesh file brings.

    Raises:
        UserError: the mesh file brings none.
    """
    if isinstance(settings.material, MaterialSettings):
        return (settings.material.material(),)
    if not mesh.materials:
        raise UserError("material.from: the mesh file brings no material; write density, young and poisson")
    return mesh.materials


def check_held(
    mesh: Mesh, settings: BodySettings, centre: Array, motions: Array, coefficients: Array | None = None
) -> None:
    """Refuse a body that floats and does not say so, and one that says so and is held.

    Args:
        motions, coefficients: see `rigid.describe`; coefficients are given where nodes have rotations.
    """
    found = motions.shape[1]
    if settings.free and not found:
        raise UserError("free: true, but the supports hold the body wholly; remove one of them")
    if found and not settings.free:
        names = "; ".join(rigid.describe(mesh.points, centre, motions, coefficients))
        turns = "" if coefficients is None else " (with rotations = true they hold the rotations of their nodes too)"
        raise UserError(
            f"supports: nothing holds the body against {names}; add supports{turns}, or write free = true if it is "
            "meant to float"
        )
    if settings.free and settings.closures and not settings.bolts:
        raise UserError("closures: nothing presses the faces of a free body together; add [[bolts]] or hold the body")
    if settings.free and settings.loads:
        raise UserError("loads: a free body has no static equilibrium under loads; hold it or remove the loads")


def refuse_uncyclic(mesh: Mesh, settings: BodySettings) -> None:
    """Refuse what a sector alone cannot say of its ring: gravity across the axis, faces inside the ring.

    Raises:
        UserError: with the key.
    """
    cyclic, axis = settings.cyclic, np.array(settings.rotation.axis)
    if cyclic is None:
        return
    for number, load in enumerate(settings.loads):
        pull = np.array(load.vector if load.kind == "gravity" else (0.0, 0.0, 0.0))
        if np.linalg.norm(np.cross(axis, pull)) > 1e-9 * np.linalg.norm(axis) * np.linalg.norm(pull):
            raise UserError(
                f"loads.{number}.vector: gravity across the rotation axis does not pull at all sectors alike; keep its "
                "part along the axis, or leave it out"
            )
    for key, face in _loaded_faces(settings):
        for cut in (cyclic.left, cyclic.right):
            if _share_facets(mesh, face, cut):
                raise UserError(
                    f"{key}: '{face}' has facets on the cut face '{cut}', which lies inside the ring; choose a face of "
                    "its surface"
                )


def _loaded_faces(settings: BodySettings) -> list[tuple[str, str]]:
    """(key, face) of all faces that touch something or are loaded."""
    named = [
        (f"{kind}.{item.name}.face", item.face)
        for kind, items in (("interfaces", settings.interfaces), ("excitations", settings.excitations))
        for item in items
    ]
    named += [(f"loads.{number}.face", load.face) for number, load in enumerate(settings.loads)]
    return [(key, face) for key, face in named if face is not None]


def _share_facets(mesh: Mesh, face: str, cut: str) -> bool:
    on = np.zeros(mesh.n_points, dtype=bool)
    on[mesh.face_points(cut)] = True
    return any(on[facets].all(axis=1).any() for facets in mesh.faces.get(face, {}).values())


PHYSICAL = ("craig-bampton", "dual-craig-bampton", "massless-boundary")


def refuse_overlap(mesh: Mesh, settings: BodySettings) -> None:
    """Refuse interface coordinates of a patch that lies on a support.

    Raises:
        UserError: with the patch and the support.
    """
    kept = [i for i in settings.interfaces if settings.reduction in PHYSICAL or i.coordinates == "characteristic"]
    for item in kept:
        for support in settings.supports:
            held = mesh.face_points(support.face)
            facets = mesh.faces[item.face].values()
            count = sum(int(np.isin(f, held).all(axis=1).sum()) for f in facets)
            if count:
                raise UserError(
                    f"interfaces.{item.name}.face: {count} of {sum(map(len, facets))} facets of '{item.face}' lie on "
                    f"the support '{support.face}', which holds them, so the patch has no coordinates of its own; "
                    'take them out of one of the two, or use reduction = "rubin" and coordinates = "rigid"'
                )
        if settings.cyclic and item.coordinates == "characteristic":
            raise UserError(
                f"interfaces.{item.name}.coordinates: characteristic shapes are made of a lone body, not of a sector "
                '([cyclic]); use "rigid"'
            )


def with_dead_loads(model: BodyModel, mesh: Mesh, settings: BodySettings) -> BodyModel:
    force = np.zeros((mesh.n_points, 3))
    locator = Locator(mesh) if any(load.point for load in settings.loads) else None
    for number, load in enumerate(settings.loads):
        if load.kind == "gravity":
            force += body_force(model.M_full, np.array(load.vector))
        elif load.kind == "pressure":
            require_face(mesh, load.face or "", f"loads.{number}.face")
            force += pressure(face_blocks(mesh, load.face or ""), mesh.n_points, load.value or 0.0)
        elif load.face is not None:
            require_face(mesh, load.face, f"loads.{number}.face")
            blocks = face_blocks(mesh, load.face)
            area = sum(np.linalg.norm(b.area, axis=2).sum() for b in blocks)
            force += traction(blocks, mesh.n_points, np.array(load.vector) / area)
        else:
            assert locator is not None
            place = locator.find(np.array(load.point), f"loads.{number}.point")
            force[place.nodes] += place.N[:, None] * np.array(load.vector)
    return replace(model, dead_load=force)
