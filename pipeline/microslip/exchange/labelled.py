"""A basis as xarray sees it: a tree of data sets with named axes, units in the attributes.

``/`` the mesh's points, ``/speed_0`` or ``/speed_0/nd_3`` a group. Complex arrays are complex. Nothing is copied that
xarray need not copy; a slash in a name, which xarray keeps for paths, is written %2F, a % then %25, as in the modal
file; a variable of an axis's name gets an underscore behind it. Nothing is written: ``tree.to_netcdf`` or
``tree["speed_0"].to_dataset()`` do what is wanted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..data import INTERFACE_ROWS, VOIGT, ModalBasis, ModalGroup, Rows
from ..settings.arguments import checked
from .choice import STATEMENT, node_numbers

_UNITS = {
    "omega": "rad/s", "frequency": "Hz", "M_r": "1", "C_r": "1/s", "K_r": "1/s2", "G_r": "1/s", "N_r": "1/s2",
    "phi": "kg^-1/2", "u_static": "m", "xyz": "m", "damping_ratio": "1",
}  # fmt: skip


@checked
def to_xarray(basis: ModalBasis) -> Any:
    """A modal basis as an `xarray.DataTree`; needs the package xarray (``microslip[exchange]``).

    Axes: node, axis, mode (the coordinates), own_mode (where they differ), row, component. Of a body without sectors a
    group is ``/speed_0``, of a sector ``/speed_0/nd_0``.
    """
    import xarray

    tree = {"/": _root(basis, xarray)}
    for (speed, harmonic), group in sorted(basis.groups.items()):
        place = f"/speed_{speed}" + (f"/nd_{harmonic}" if basis.sectors > 1 else "")
        tree[place] = _group(group, xarray)
    return xarray.DataTree.from_dict(tree, name=_name(basis.name))


def _name(name: str) -> str:
    return name.replace("%", "%25").replace("/", "%2F")


def _root(basis: ModalBasis, xarray: Any) -> Any:
    return xarray.Dataset(
        {"xyz": (("node", "axis"), basis.mesh.points, {"units": "m"})},
        coords={"node": node_numbers(basis), "axis": list("xyz")},
        attrs={"name": basis.name, "reduction": basis.reduction, "sectors": basis.sectors, "conventions": STATEMENT},
    )


def _group(g: ModalGroup, xarray: Any) -> Any:
    own = "mode" if g.to_diagonal is None else "own_mode"
    table: dict[str, Any] = {name: ((own,), getattr(g, name)) for name in ("omega", "frequency", "damping_ratio")}
    table |= {name: (("mode", "mode_column"), getattr(g, name)) for name in ("M_r", "C_r", "K_r", "G_r")}
    if g.N_r is not None:
        table["N_r"] = (("mode", "mode_column"), g.N_r)
    if g.to_diagonal is not None:
        table["to_diagonal"] = (("mode", "own_mode"), g.to_diagonal)
    if len(g.phi):
        table["phi"] = (("node", "axis", "mode"), g.phi)
    table["u_static"] = (("node", "axis"), g.u_static)
    coords: dict[str, Any] = {"mode": np.arange(1, g.n_modes + 1), "kind": (("mode",), list(g.kind))}
    table |= {f"interface_{_name(n)}": (("interface_row", "mode"), i.rows) for n, i in g.interfaces.items()}
    for kind, named in (("excitation", g.excitations), ("monitor", g.monitors), ("gauge", g.gauges)):
        table |= _rows(kind, named, coords)
    table |= _compliance(g, coords) | _stress(g, coords)
    if any("interface_row" in entry[0] for entry in table.values()):
        coords["interface_row"] = list(INTERFACE_ROWS)
    axes = {*coords, *(axis for entry in table.values() for axis in entry[0])}
    named_units = {
        n + "_" * (n in axes): (d, v, {"units": _UNITS[n]} if n in _UNITS else {}) for n, (d, v, *_) in table.items()
    }
    attrs = {"speed_rad_per_s": g.speed, "nodal_diameter": g.harmonic, "prestress": g.prestress}
    return xarray.Dataset(named_units, coords=coords, attrs=attrs)


def _rows(kind: str, named: Mapping[str, Rows], coords: dict[str, Any]) -> dict[str, Any]:
    table = {}
    for name, rows in named.items():
        axis = f"{kind}_{_name(name)}_row"
        coords[axis] = list(rows.labels)
        table[f"{kind}_{_name(name)}"] = ((axis, "mode"), rows.rows)
    return table


def _compliance(g: ModalGroup, coords: dict[str, Any]) -> dict[str, Any]:
    if not g.compliance.labels:
        return {}
    coords["compliance_row"] = (("compliance_row",), list(g.compliance.labels))
    coords["compliance_column"] = (("compliance_column",), list(g.compliance.labels))
    axes = ("compliance_row", "compliance_column")
    return {"compliance_static": (axes, g.compliance.static), "compliance_modal": (axes, g.compliance.modal)}


def _stress(g: ModalGroup, coords: dict[str, Any]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for name, s in g.stresses.items():
        place = f"{name}_place"
        coords["component"] = list(VOIGT)
        table[f"stress_{name}"] = ((place, "component", "mode"), s.stress)
        table[f"stress_static_{name}"] = ((place, "component"), s.static_stress)
        table[f"stress_point_{name}"] = ((place, "axis"), s.points)
    return table
