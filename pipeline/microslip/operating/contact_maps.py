"""A contact patch over one cycle, point by point: pressure, traction, slip, dissipated energy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..contact.patch import Patch
from ..data import Array, ComplexArray, Indices, Interface
from ..exchange import vtu


@dataclass(frozen=True)
class ContactMap:
    """What n point contacts do in one cycle.

    Attributes:
        name. places: (n, 2) m along t1 and t2 from the patch's origin. areas: (n,) m2. origin: (3,) m and rotation:
            (3, 3) rows n, t1, t2 of the side it is drawn on, body axes.
        pressure_mean, pressure_least, pressure_most: (n,) Pa, nothing where open; of the book's mode mean and first
            harmonic, which may go below nothing. traction: (n,) Pa, largest swing of the
            tangential traction about its mean. tractions: (n, 3, H + 1) complex harmonics, Pa along n, t1, t2, of the
            traction on the body, the mean first; pressure is negative there.
        dissipated: (n,) J/m2 a cycle that the law counts as lost, in friction, dampers and stretched area that opens;
            the work done on the contact where it counts nothing. sticking, slipping, open: (n,) shares of the cycle.
        work: J a cycle, done on the whole patch, as the balance has it. samples: of the cycle, by whose steps the two
            differ.
        by_samples: the largest change of a pressure or traction from one sample to the next, over the largest of all:
            how far least and most may be off.
    """

    name: str
    places: Array
    areas: Array
    origin: Array
    rotation: Array
    pressure_mean: Array
    pressure_least: Array
    pressure_most: Array
    traction: Array
    tractions: ComplexArray
    dissipated: Array
    sticking: Array
    slipping: Array
    open: Array
    work: float
    samples: int
    by_samples: float

    def span(self, name: str) -> tuple[float, float]:
        """The smallest and the largest value of one of its fields."""
        values = getattr(self, name)
        return float(values.min()), float(values.max())

    @property
    def points(self) -> Array:
        """(n, 3) m, body axes."""
        return self.origin + self.places @ self.rotation[1:]

    @property
    def normal_force(self) -> float:
        """Mean normal force of the patch, N."""
        return float(self.areas @ self.pressure_mean)

    @property
    def loss(self) -> float:
        """J per cycle of the whole patch."""
        return float(self.areas @ self.dissipated)

    @property
    def unbalanced(self) -> float:
        """J per cycle by which the work that the balance has differs from `loss`; 0 where the shown digits hold."""
        rest = self.work - self.loss
        return rest if abs(rest) > 0.01 * abs(self.loss) else 0.0


def contact_map(
    patch: Patch, side: Interface, force: Array, taken: Array, slipping: Array, open_: Array, harmonics: int,
    work: float, phase: float = 0.0,
) -> ContactMap:  # fmt: skip
    """A patch from what a force model says of its n points in a cycle; nothing is computed anew.

    Args:
        side: where it is drawn. force: (s, n, 3) N along n, t1, t2 in s samples of the cycle. taken: (n,) J lost in
            it. slipping, open_: (n,) shares of it. harmonics: H, of the tractions. work: J a cycle, done on the patch.
            phase: rad by which the wave leads the samples in the first harmonic.
    """
    p = force / patch.areas[None, :, None]
    swing = p[..., 1:] - p[..., 1:].mean(axis=0)
    waves_of = np.moveaxis(np.fft.rfft(p, axis=0)[: harmonics + 1] * (2 / len(p)), 0, -1)
    waves_of *= np.exp(1j * phase * np.arange(harmonics + 1))
    waves_of[..., 0] *= 0.5
    jumps = np.abs(p - np.roll(p, 1, axis=0)).max(initial=0.0)
    return ContactMap(
        patch.interface, patch.points, patch.areas, side.origin, side.rotation,
        p[..., 0].mean(axis=0), p[..., 0].min(axis=0), p[..., 0].max(axis=0),
        np.linalg.norm(swing, axis=-1).max(axis=0),
        -waves_of, taken / patch.areas, np.maximum(1.0 - slipping - open_, 0.0), slipping, open_,
        work, len(p), float(jumps / max(np.abs(p).max(initial=0.0), 1e-300)),
    )  # fmt: skip


# drawing -----------------------------------------------------------------------------------------------------------


def grid_of(places: Array) -> tuple[Array, Array] | None:
    """Edges along t1 and along t2 of the rectangles whose centres the places are; None where they are no grid."""
    axes = []
    for x in places.T:
        centres = np.unique(np.round(x, 12))
        step = np.diff(centres)
        if len(step) and step.max() > 1.001 * step.min():
            return None
        axes.append((centres, step.mean() if len(step) else 0.0))
    (y, dy), (z, dz) = axes
    if len(y) * len(z) != len(places) or not (dy or dz):
        return None
    dy, dz = dy or dz, dz or dy
    return np.append(y - dy / 2, y[-1] + dy / 2), np.append(z - dz / 2, z[-1] + dz / 2)


def on_grid(places: Array, values: Array) -> Array:
    """(n_z, n_y) values of the points of a grid, t1 to the right."""
    y, z = (np.unique(np.round(x, 12), return_inverse=True)[1] for x in places.T)
    out = np.full((z.max() + 1, y.max() + 1), np.nan)
    out[z, y] = values
    return out


def write_contact_vtu(found: ContactMap, path: Path | str) -> None:
    """The patch as a VTU file: rectangles of a grid, or points.

    Cell data (point data without a grid): ``pressure_mean``, ``pressure_least``, ``pressure_most``, ``traction``,
    Pa; ``traction_mean``, ``traction_h1_real``, ``traction_h1_imag``, ... (3,) Pa on the body, body axes;
    ``dissipated`` J/m2 a cycle; ``sticking``, ``slipping``, ``open``; ``area`` m2.

    Raises:
        UserError: no permission, no space.
    """
    import meshio

    data = _fields(found)
    points, cells = _rectangles(found)
    kind = "quad" if cells.shape[1] == 4 else "vertex"
    vtu.save(meshio.Mesh(points, {kind: cells}, cell_data={k: [v] for k, v in data.items()}), path)


def _fields(found: ContactMap) -> dict[str, Any]:
    names = (
        "pressure_mean",
        "pressure_least",
        "pressure_most",
        "traction",
        "dissipated",
        "sticking",
        "slipping",
        "open",
    )
    data = {name: vtu.single(getattr(found, name)) for name in names}
    turned = np.einsum("nah,ab->nbh", found.tractions, found.rotation)
    data["traction_mean"] = vtu.single(turned[..., 0].real)
    for h in range(1, turned.shape[2]):
        data[f"traction_h{h}_real"], data[f"traction_h{h}_imag"] = (
            vtu.single(part) for part in (turned[..., h].real, turned[..., h].imag)
        )
    return data | {"area": vtu.single(found.areas)}


def _rectangles(found: ContactMap) -> tuple[Array, Indices]:
    """Points (., 3) and cells: four corners of each rectangle in the order of the places, or the points alone."""
    edges = grid_of(found.places)
    if edges is None:
        return found.points, np.arange(len(found.places))[:, None]
    (dy, dz) = (e[1] - e[0] for e in edges)
    corners = found.places[:, None] + 0.5 * np.array([[-dy, -dz], [dy, -dz], [dy, dz], [-dy, dz]])
    points = found.origin + corners.reshape(-1, 2) @ found.rotation[1:]
    return points, np.arange(len(points)).reshape(-1, 4)
