"""Universal File Format (.uff, .unv): nodes and shapes as test programs (pyuff, pyEMA, SDTools, Testlab) read them.

Written to the published descriptions of the data sets: 151 header, 164 units (SI), 2411 nodes (double precision), 2412
the surface as triangles and quadrilaterals to draw, one 55 a mode. A data set 55 prints six digits, for frequency,
damping and shape alike. Real shapes are normal modes (analysis type 2: frequency in Hz, modal mass 1, viscous damping
ratio); the complex ones of a sector are complex eigenvalues (type 3) with eigenvalue -D omega + i omega sqrt(1 - D^2),
1/s, and modal A = phi^H (2 lambda M + C) phi = 2 i omega sqrt(1 - D^2), B = phi^H (K - lambda^2 M) phi = -lambda A.
Components are displacements along x, y, z of the mesh's frame, kg^-1/2.

The speed's number counted from 1 stands as the load case; ID line 4 tells speed and nodal diameter.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .. import __version__
from ..data import Array, Indices, ModalBasis, ModalGroup
from ..files.store import write_text
from ..mesh import boundary_facets
from ..ring.resonances import eigenmodes
from ..units import rpm_text
from .choice import Format, node_numbers, one_line, with_shapes

TRIANGLE, QUAD = 41, 44
"""FE descriptors of data set 2412 (linear plane-stress elements, which stand for a skin to draw)."""


def write_uff(basis: ModalBasis, path: Path | str) -> None:
    """Write nodes and the eigenmodes of all groups, complete or absent. Same basis, same bytes.

    Raises:
        UserError: shapes are not stored, no permission, no space.
    """
    nodes = node_numbers(basis)
    parts = [_header(basis), _units(), _nodes(nodes, basis.mesh.points), _skin(basis, nodes)]
    for (speed, _), group in sorted(basis.groups.items()):
        parts += _modes(basis, with_shapes(basis, eigenmodes(group), "uff"), speed, nodes)
    write_text(path, "".join(parts))


def _set(number: int, lines: list[str]) -> str:
    return f"{-1:6d}\n{number:6d}\n" + "".join(f"{line}\n" for line in lines) + f"{-1:6d}\n"


def _header(basis: ModalBasis) -> str:
    """Data set 151. Its dates mean nothing: the same basis gives the same bytes."""
    program = f"microslip {__version__}"
    date = f"{'01-Jan-00':<10}{'00:00:00':<10}"
    said = "modal basis; SI; frame of the mesh, x y z of each node; phi^H M phi = 1"
    return _set(151, [_line(basis.name), said, program, date + f"{0:10d}{0:10d}{0:10d}", date, program, date])


def _line(text: str) -> str:
    """A text line of the format: 80 columns of ASCII, not blank."""
    return one_line(text)[:80].strip() or "NONE"


def _units() -> str:
    """Data set 164: SI, absolute temperatures (type 2 would be relative)."""
    return _set(164, [f"{1:10d}{'SI: Meter (newton)':<20}{1:10d}", _wide([1.0, 1.0, 1.0], 17), _wide([0.0], 17)])


def _wide(values: list[float], digits: int = 16) -> str:
    return "".join(f"{v:25.{digits}E}".replace("E", "D") for v in values)


def _nodes(nodes: Indices, points: Array) -> str:
    """Data set 2411: double precision, all in the global rectangular system."""
    lines = []
    for number, (x, y, z) in zip(nodes.tolist(), points.tolist(), strict=True):
        lines += [f"{number:10d}{1:10d}{1:10d}{11:10d}", _wide([x, y, z])]
    return _set(2411, lines)


def _skin(basis: ModalBasis, nodes: Indices) -> str:
    """Data set 2412: the surface by the corners of its facets, outwards."""
    lines, number = [], 0
    for kind, facets in boundary_facets(basis.mesh).items():
        descriptor, corners = (QUAD, 4) if kind.startswith("quad") else (TRIANGLE, 3)
        for facet in nodes[facets[:, :corners]].tolist():
            number += 1
            lines.append("".join(f"{v:10d}" for v in (number, descriptor, 1, 1, 7, corners)))
            lines.append("".join(f"{v:10d}" for v in facet))
    return _set(2412, lines) if lines else ""


def _modes(basis: ModalBasis, g: ModalGroup, speed: int, nodes: Indices) -> Iterator[str]:
    where = f"{rpm_text(g.speed)}, nodal diameter {g.harmonic}, {basis.sectors} sectors"
    complex_shapes = np.iscomplexobj(g.phi)
    for j in range(g.n_modes):
        lines = [_line(basis.name), "mode shape, kg^-1/2, phi^H M phi = 1", "NONE", where[:80]]
        lines.append(f"{'Mode Same':<10}{j + 1:10d}{' Frequency':<10}{g.frequency[j]:13.5e}"[:80])
        lines.append("".join(f"{v:10d}" for v in (1, 3 if complex_shapes else 2, 2, 8, 5 if complex_shapes else 2, 3)))
        lines += _parameters(g, j, speed, complex_shapes)
        values = _interleaved(g.phi[:, :, j]) if complex_shapes else g.phi[:, :, j]
        for number, row in zip(nodes.tolist(), values.tolist(), strict=True):
            lines += [f"{number:10d}", "".join(f"{v:13.5e}" for v in row)]
        yield _set(55, lines)


def _parameters(g: ModalGroup, j: int, speed: int, complex_shapes: bool) -> list[str]:
    """Records 7 and 8 of data set 55."""
    omega, D = float(g.omega[j]), float(g.damping_ratio[j])
    if not complex_shapes:
        numbers = [omega / (2 * np.pi), 1.0, D, 0.0]
    else:
        damped = omega * np.sqrt(max(1 - D**2, 0.0))
        numbers = [-D * omega, damped, 0.0, 2 * damped, 2 * damped**2, 2 * D * omega * damped]
    head = f"{2:10d}{len(numbers):10d}{speed + 1:10d}{j + 1:10d}"
    return [head, "".join(f"{v:13.5e}" for v in numbers)]


def _interleaved(shape: Array) -> Array:
    """(n, 6) real and imaginary part of each component in turn."""
    return np.stack([shape.real, shape.imag], axis=2).reshape(len(shape), 6)


FORMATS = (Format("uff", ".uff", "test programs: universal file format", write_uff),)
