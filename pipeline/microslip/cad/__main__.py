"""Command line of the CAD route; see the package's docstring."""

from __future__ import annotations

import sys
from pathlib import Path

import gmsh

from microslip.cad.drawing import default_size, finish, guarded, name_body, positive_size, read_settings
from microslip.cad.faces import name_picked, table, write_triangles
from microslip.cad.imprint import imprint
from microslip.cad.parts import set_apart, tell_touches
from microslip.cad.solids import load


def mesh_cad(settings_file: str, out: str) -> None:
    """Read geometry.cad, name the faces that geometry.faces picks, mesh."""
    settings = read_settings(settings_file)
    geometry, unit = settings.get("geometry", {}), settings.get("length_unit", "m")
    marks = load(Path(settings["folder"]) / geometry.get("cad", ""), unit)
    name_picked(*reversed(imprint(geometry.get("faces", []), marks, Path(settings["folder"]), unit)))
    name_body()
    mesh = dict(settings.get("mesh", {}))
    size = mesh["size"] = default_size() if mesh.get("size") is None else mesh["size"]
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)  # elements around a full circle, as far as
    smallest = min([positive_size("mesh.size", size), *mesh.get("local", {}).values()])
    gmsh.option.setNumber("Mesh.MeshSizeMin", smallest / 3)
    finish(mesh, out)


def tell(cad: str, unit: str, triangles: str = "", coarse: str = "") -> None:
    """Print the table of a CAD file; write triangles for a picture of it if a file is named."""
    print(table(Path(cad), unit))
    if triangles:
        write_triangles(triangles, unit, bool(coarse))


def main(arguments: list[str]) -> None:
    """Command line: see the package's docstring."""
    if len(arguments) in (3, 4, 5) and arguments[0] == "--list":
        guarded(lambda: tell(*arguments[1:]), arguments[1])
    elif len(arguments) == 3 and arguments[0] == "--apart":
        guarded(lambda: set_apart(*arguments[1:]), arguments[1])
    elif len(arguments) > 3 and arguments[0] == "--touches":
        guarded(lambda: tell_touches(*arguments[1:]), "import.json")
    elif len(arguments) == 2:
        guarded(lambda: mesh_cad(*arguments), arguments[0])
    else:
        ways = "SETTINGS OUT.msh | --list FILE UNIT [OUT.npz [coarse]] | --apart FILE FOLDER | --touches UNIT FILES"
        sys.exit(f"usage: python -m microslip.cad {ways}")


if __name__ == "__main__":
    main(sys.argv[1:])
