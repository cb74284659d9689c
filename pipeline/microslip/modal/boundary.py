"""Supports and dead loads of a body file on its mesh, and the refusal of bodies that nothing holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import lsqr

from ..data import Array, BodyLoad, FacetLoad, Indices, Material, Mesh, NodalLoad
from ..errors import UserError
from ..fem.cyclic import CyclicUpper
from ..fem.discretise import Discretisation, face_blocks, facet_block, whole
from ..fem.loads import FollowingPressure, body_force, cells_force, corner_traction, pressure, traction
from ..fem.tied import Tied
from ..settings.body import BodySettings, MaterialSettings
from ..topology import FACET_CORNERS
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
    turns = ["".join("abc"[turn - 3] for turn in s.turns) for s in settings.supports]
    held = [
        (s.face, f"{s.directions}{more}") for s, more in zip(settings.supports, turns, strict=True)
    ]
    return held_dofs(mesh, held)


def still_dofs(mesh: Mesh, settings: BodySettings) -> Indices | None:
    """Those held in the mesh file's static step, where its loads act and it holds others than its modes."""
    loaded = any(load.kind == "mesh" for load in settings.loads)
    own = loaded and mesh.state is not None and mesh.state.supports is not None
    return held_dofs(mesh, list(mesh.state.supports.items())) if own else None  # type: ignore[union-attr]


def held_dofs(mesh: Mesh, held: Sequence[tuple[str, str]]) -> Indices:
    """Degrees of freedom of faces or point sets held in directions x, y, z and rotations a, b, c.

    Raises:
        UserError: a face that is not there.
    """
    fixed = [np.zeros(0, dtype=np.int64)]
    for face, ways in held:
        nodes = np.zeros(0, dtype=np.int64)
        moves = mesh.ties.sets.get(face, nodes) if mesh.ties is not None else nodes
        if not len(moves) or face in {*mesh.faces, *mesh.point_sets}:
            require_face(mesh, face, f"supports.{face}.face", points_suffice=True)
            nodes = mesh.set_points(face)
        fixed += [3 * nodes + AXES[c] for c in ways if c in AXES]
        fixed += [3 * mesh.n_points + 6 * moves + "xyzabc".index(c) for c in ways]
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


def refuse_other_supports(settings: BodySettings) -> None:
    """Refuse what has one set of supports, where a static step has others than its modes.

    Raises:
        UserError: with the key.
    """
    if settings.rotation.range_rpm is not None:
        raise UserError(
            "rotation.range_rpm: the static step of the mesh file holds the body otherwise than its modes, "
            "which a range does not know; write speeds_rpm"
        )


def with_loads(model: BodyModel, mesh: Mesh, settings: BodySettings, held: Indices) -> BodyModel:
    """The model with what acts on it at every speed. held: degrees of freedom, see `fixed_dofs`.

    Raises:
        UserError: faces that are not there, displacements prescribed where nothing holds the body.
    """
    force = np.zeros((mesh.n_points, 3))
    locator = Locator(mesh) if any(load.point for load in settings.loads) else None
    for number, load in enumerate(settings.loads):
        if load.kind == "mesh":
            model, more = _with_state(model, mesh, held)
            force += more
        elif load.kind == "pressure" and load.follows:
            require_face(mesh, load.face or "", f"loads.{number}.face")
            alike = [
                FollowingPressure(t, f, np.full((len(f), FACET_CORNERS[t]), load.value or 0.0))
                for t, f in mesh.faces[load.face or ""].items()
            ]
            model = replace(model, following=(*model.following, *alike))
        elif load.kind == "gravity":
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


def _with_state(model: BodyModel, mesh: Mesh, held: Indices) -> tuple[BodyModel, Array]:
    """The model with pressures and displacements of the mesh file's static step, and (n, 3) N of what keeps its
    direction; `SpinLoad`s stand in [rotation].

    Raises:
        UserError: the file has no static step, or a displacement is prescribed where nothing holds the body.
    """
    if mesh.state is None:
        raise UserError("loads: the mesh file has no static step whose loads are read; remove kind = \"mesh\"")
    n, force, given = mesh.n_points, np.zeros((mesh.n_points, 3)), dict[int, float]()
    moments = np.zeros(6 * (0 if mesh.ties is None else len(mesh.ties.references)))
    following = []
    for load in mesh.state.loads:
        if isinstance(load, NodalLoad):
            on_points = load.nodes < n
            dofs = np.where(on_points, 3 * load.nodes, 3 * n + 6 * (load.nodes - n)) + load.directions
            if load.kind == "displacement":
                given.update(zip(dofs.tolist(), load.values.tolist(), strict=True))
                continue
            np.add.at(force.reshape(-1), dofs[on_points], load.values[on_points])
            np.add.at(moments, dofs[~on_points] - 3 * n, load.values[~on_points])
        elif isinstance(load, FacetLoad) and load.direction is None:
            following.append(FollowingPressure(load.kind, load.facets, load.values))
        elif isinstance(load, FacetLoad):
            block = facet_block(mesh, load.kind, load.facets)
            force += corner_traction(block, load.kind, n, load.values, np.asarray(load.direction))
        elif isinstance(load, BodyLoad) and load.cells is None:
            force += body_force(model.M_full, load.acceleration)
        elif isinstance(load, BodyLoad):
            density, chosen = [m.density for m in model.materials], np.asarray(load.cells, dtype=bool)
            force += cells_force(whole(model.d), density, chosen, load.acceleration)
    if moments.any():
        upper = model.free.unknowns.apart if isinstance(model.free, CyclicUpper) else model.free
        assert isinstance(upper, Tied)
        force += upper.carried(moments, n).reshape(n, 3)
    displaced = _displaced(mesh, given, held) if any(given.values()) else None
    return replace(model, following=(*model.following, *following), displaced=displaced), force


def _displaced(mesh: Mesh, given: dict[int, float], held: Indices) -> Array:
    """(n, 3) m of prescribed displacements (degree of freedom -> m or rad), continued as the ties want it."""
    dofs, values = np.array(list(given)), np.array(list(given.values()))
    if not np.isin(dofs, held).all():
        node = int(dofs[~np.isin(dofs, held)][0]) // 3
        which = f"node {mesh.node_id[node]}" if node < mesh.n_points else "a reference node"
        raise UserError(
            f"supports: the mesh file prescribes a displacement of {which}, which nothing holds; hold it in its "
            "direction, or take the loads of kind \"mesh\" out"
        )
    first = np.zeros(3 * mesh.n_points + (0 if mesh.ties is None else 6 * len(mesh.ties.references)))
    first[dofs] = values
    if mesh.ties is not None and mesh.ties.rows.shape[0]:
        C, left = mesh.ties.rows.tocsc(), np.setdiff1d(np.arange(len(first)), held)
        answer = lsqr(C[:, left], -(C @ first), atol=1e-15, btol=1e-15, iter_lim=10 * len(left))
        first[left] = answer[0]
    return first[: 3 * mesh.n_points].reshape(-1, 3)
