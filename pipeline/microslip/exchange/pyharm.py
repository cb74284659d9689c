"""The .mat that pyHarm's generic reader takes: M, K, C, G with the physical coordinates first, a node an interface.

pyHarm counts ``ndofs`` physical coordinates a node, node by node, then modal ones: its dictionary is ``{"filename":
..., "ndofs": 6, "nmodes": nmodes}``, and all these numbers stand in the file. Node i is the i-th name in ``nodes``;
its coordinates 0 to 5 are u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2 in the frame of the interface. Characteristic
coordinates stand among the modal ones. pyHarm's G is a gyroscopic matrix per rad/s of a shaft that turns at the
frequency of the vibration; of a body at its own speed it stands in C, ``C = C_r + G_r``, and G is 0.

So the body must be reduced to interface displacements, by Craig-Bampton or with a massless boundary; a place where a
force is to act or a displacement to be read must be an interface (role ``load``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..data import INTERFACE_ROWS, Indices, ModalBasis, ModalGroup
from ..errors import UserError
from ..files.store import complete_or_absent
from .choice import STATEMENT, Format, only_group, real
from .mat import clean_header, words
from .mtx import interface_coordinates


def write_pyharm(basis: ModalBasis, path: Path | str) -> None:
    """Write one group, complete or absent. Same basis, same bytes.

    Raises:
        UserError: several groups, complex shapes, interface displacements are not coordinates, no permission.
    """
    tables = pyharm_tables(basis, real(only_group(basis, "pyharm"), "pyharm"))
    from scipy.io import savemat

    with complete_or_absent(path) as temporary:
        savemat(temporary, tables, appendmat=False, oned_as="column")
        clean_header(temporary)


def pyharm_tables(basis: ModalBasis, g: ModalGroup) -> dict[str, Any]:
    """What the file holds.

    Raises:
        UserError: interface displacements are not coordinates.
    """
    nodes, order = physical_first(basis, g, "pyharm")
    N = np.zeros_like(g.K_r) if g.N_r is None else g.N_r
    some, faces = np.ix_(order, order), [g.interfaces[name] for name in nodes]
    M, K = g.M_r[some], g.K_r[some]
    loads = [rows.rows for rows in g.excitations.values()]
    names = [f"{name}:{label}" for name, rows in g.excitations.items() for label in rows.labels]
    return {
        "M": (M + M.T) / 2, "K": (K + K.T) / 2 + N[some], "C": (g.C_r + g.G_r)[some],
        "G": np.zeros_like(g.G_r),
        "ndofs": 6.0, "nnodes": float(len(nodes)), "nmodes": float(g.n_modes - 6 * len(nodes)),
        "nodes": words(nodes),
        "dofs": words(INTERFACE_ROWS),
        "kind": words(g.kind[j] for j in order),
        "origin": np.array([i.origin for i in faces]),
        "rotation": np.array([i.rotation for i in faces]),
        "Fex": np.concatenate(loads)[:, order].T if loads else np.zeros((g.n_modes, 0)),
        "Fex_name": words(names),
        "omega": g.omega, "Omega": g.speed,
        "readme": f"{basis.name}: {STATEMENT}. Physical coordinates first: for each of nodes the six dofs in its frame "
        "(rotation has n, t1, t2 as rows, n outwards), then nmodes modal ones. "
        "C holds damping and the gyroscopic matrix at Omega. "
        "Check: eigenvalues of (K, M) are omega^2 (without the massless coordinates).",
    }  # fmt: skip


def physical_first(basis: ModalBasis, g: ModalGroup, form: str) -> tuple[list[str], Indices]:
    """Names of the interfaces that are nodes, and (m,) the coordinates in their order: six a node, then the others.

    Raises:
        UserError: interface displacements are not coordinates.
    """
    column = {text: j for j, text in interface_coordinates(g).items()}
    nodes = [name for name in g.interfaces if all(f"{name}:{row}" in column for row in INTERFACE_ROWS)]
    if not nodes:
        raise UserError(
            f"{basis.name}: export --to {form}: it wants the displacements of the interfaces as coordinates; give "
            f'the body [[interfaces]] and compute it with reduction = "craig-bampton" or "massless-boundary" '
            f'(the file has "{basis.reduction}")'
        )
    first = [column[f"{name}:{row}"] for name in nodes for row in INTERFACE_ROWS]
    return nodes, np.array(first + [j for j in range(g.n_modes) if j not in set(first)])


FORMATS = (Format("pyharm", "_pyharm.mat", "pyHarm", write_pyharm),)
