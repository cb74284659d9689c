"""Pictures of a modal file, drawn without a display: `can_draw`, `draw_all`.

`scene` and `views` draw the body by PyVista, `lettering` writes round it, `plots` draws curves by matplotlib.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..data import ModalBasis, ModalGroup
from ..modal.campbell import track_basis
from ..progress import Report
from ..reduced.coordinates import basis_in_modes
from ..ring.expansion import multiplicity
from ..ring.resonances import eigenmodes
from ..units import to_rpm
from . import plots
from .lettering import save_gif, save_png
from .scene import quiet_vtk
from .turning import stress_modes, turning_modes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .lettering import Picture
    from .views import Studio


PACKAGES = ("libglu1-mesa", "libgl1", "libxcursor1", "libxft2", "libxinerama1", "libgomp1", "libegl1")
"""What a bare Debian or Ubuntu lacks for gmsh and VTK."""

MOST_MODES = 40
"""Modes drawn per speed."""

ANIMATED, STRESSED = 3, 6
"""Modes that move, and modes whose stress is shown."""

RING_ROWS, RING_COLUMNS, WAVES = 4, 3, 2
"""Nodal diameters and modes on the sheet of the ring, and waves that move."""

PATIENCE = 600
"""Seconds in which PyVista has to draw a sphere; two will do where nothing else runs."""

_PROBE = """
from microslip.pictures.scene import quiet_vtk
quiet_vtk()
import matplotlib, pyvista
p = pyvista.Plotter(off_screen=True, window_size=[40, 40])
p.add_mesh(pyvista.Sphere())
raise SystemExit(0 if p.screenshot(return_img=True).min() < 250 else 3)
"""


def can_draw() -> str | None:
    """Whether PyVista can draw here: None, or a sentence that says why not and what to install.

    Tried once, in a process of its own, because VTK ends the process when a library of OpenGL is missing.
    """
    return _tried(sys.executable)


@cache
def _tried(python: str) -> str | None:
    """What `can_draw` says of this Python."""
    root = str(Path(__file__).parents[2])
    command = [python, "-c", f"import sys; sys.path.insert(0, {root!r})\n{_PROBE}"]
    try:
        tried = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return f"PyVista drew nothing in {PATIENCE} s, wait until the machine is less busy"
    except (OSError, subprocess.SubprocessError) as error:
        return f"PyVista could not be tried ({type(error).__name__})"
    if tried.returncode == 0:
        return None
    last = (tried.stderr.strip().splitlines() or ["no message"])[-1][:160]
    if "ModuleNotFoundError" in last:
        return f"{last.removeprefix('ModuleNotFoundError: ')}; install microslip[viz]"
    cause = "crashed" if tried.returncode < 0 else f"failed ({last})"
    return f"PyVista {cause}; on Debian or Ubuntu: apt-get install {' '.join(PACKAGES)}"


def draw_all(
    basis: ModalBasis,
    folder: Path | str,
    report: Report = lambda _: None,
    engine_orders: Sequence[int] = (),
    scenes: bool = True,
) -> dict[str, Path]:
    """Draw everything a modal file can show.

    Args:
        basis: what to show. folder: where the files go. report: told what is done. engine_orders: lines of the
            Campbell diagram. scenes: False leaves out what needs PyVista (see `can_draw`).

    Returns:
        Picture name -> file, in the order of the report: ``mesh``, ``interfaces``, ``modes_<rpm>rpm`` (sheets),
        ``mode_<number>_<rpm>rpm``, ``animation_<number>``, ``stress_modes``, ``static``, ``compliance``,
        ``closure``, ``campbell``; of a cyclic sector also ``ring_modes_<rpm>rpm``, ``ring_wave_nd<k>``,
        ``nodal_diameters`` and ``safe``, while the pictures of the sector itself are those of its lowest nodal
        diameter (real parts of the shapes), those of stresses of the lowest that has stress modes. What does not
        apply to the body is not there.
    """
    basis = basis_in_modes(basis)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawn: dict[str, Path] = {}
    if scenes and basis.mesh.n_cells:  # a system by hand or a test has points alone
        drawn |= _scenes(basis, folder, report)
    report("curves")
    for name, draw in _curves(basis, engine_orders).items():
        figure = plots.figure_of(draw)
        if figure.axes:
            drawn[name] = plots.save_figure(figure, folder / f"{name}.png")
    return drawn


def _curves(basis: ModalBasis, orders: Sequence[int]) -> dict[str, Callable[[Figure], None]]:
    """What matplotlib can show; what does not apply to the body leaves its figure empty."""
    from . import diagrams
    from .points import points_sheet

    found: dict[str, Callable[[Figure], None]] = {}
    if not basis.mesh.n_cells:
        group = _ends(basis)[0]
        found[f"modes_{_rpm(group)}"] = partial(points_sheet, basis, group)
    found["compliance"] = partial(plots.compliance_plot, basis, basis.groups[min(basis.groups)])
    found["closure"] = partial(plots.closure_plot, basis)
    if basis.sectors > 1:
        return found | {
            "nodal_diameters": partial(diagrams.nodal_diameter_plot, basis),
            "nodal_diameters_stuck": partial(diagrams.stuck_plot, basis),
            "safe": partial(diagrams.safe_plot, basis, orders),
            "campbell": partial(diagrams.cyclic_campbell_plot, basis, orders),
        }
    if (tracks := track_basis(basis)) is not None:
        found["campbell"] = partial(diagrams.campbell_plot, basis, tracks, orders)
    return found


def _scenes(basis: ModalBasis, folder: Path, report: Report) -> dict[str, Path]:
    from PIL import Image

    quiet_vtk()
    from . import views

    drawn: dict[str, Path] = {}

    def keep(name: str, image: Picture | None, body: str = "") -> None:
        if image is not None:
            drawn[name] = save_png(image, folder / f"{name}.png", body)

    studio = views.open_studio(basis)
    try:
        if basis.sectors > 1:
            drawn |= _ring(basis, studio, folder, report)
        report("pictures of mesh and interfaces")
        keep("mesh", views.mesh_picture(studio))
        keep("interfaces", views.interface_picture(studio))
        keep("static", views.static_picture(studio, _with_static_stress(basis, _ends(basis)[-1])))
        stressed = studio
        if basis.sectors > 1:
            stressed = replace(studio, basis=_sector(basis, _stressed(basis)))
            studio = replace(studio, basis=_sector(basis, _shaped(basis)))
        shown = [g for g in _ends(studio.basis) if len(g.phi)]
        if shown:
            camera = views.mode_camera(studio, shown, MOST_MODES)
            for group in shown:
                report(f"pictures of {min(group.n_modes, MOST_MODES)} modes{views.at_speed(group)}")
                images = list(views.mode_pictures(studio, group, MOST_MODES, camera))
                body = turning_modes(studio.basis, group)
                keep(f"modes_{_rpm(group)}", views.contact_sheet(studio, group, images), body)
                for j, image in enumerate(images):
                    mode = views.mode_caption(studio, image, group, j)  # 256 colours: a third of the size
                    keep(f"mode_{j + 1:02d}_{_rpm(group)}", mode.quantize(256, dither=Image.Dither.NONE))
            report("animations")
            drawn |= _animations(studio, shown[0], folder)
            report("pictures of stresses")
            group = _ends(stressed.basis)[0]
            body = stress_modes(stressed.basis, group, STRESSED)
            keep("stress_modes", views.stress_sheet(stressed, group, STRESSED, camera), body)
    finally:
        studio.stage.close()
    return drawn


def _ends(basis: ModalBasis) -> list[ModalGroup]:
    """The groups of the lowest and the highest speed (one if they are the same)."""
    keys = sorted(k for k in basis.groups if k[1] == min(basis.groups)[1])
    return [basis.groups[k] for k in dict.fromkeys((keys[0], keys[-1]))]


def _stressed(basis: ModalBasis) -> int:
    """The lowest nodal diameter whose stress modes the file holds at its nodes, else the lowest of all."""
    return min((k for (_, k), g in basis.groups.items() if "nodes" in g.stresses), default=min(basis.groups)[1])


def _shaped(basis: ModalBasis) -> int:
    """The lowest nodal diameter of which the file holds shapes, else the lowest of all."""
    return min((k for (_, k), g in basis.groups.items() if len(g.phi)), default=min(basis.groups)[1])


def _with_static_stress(basis: ModalBasis, group: ModalGroup) -> ModalGroup:
    """The group with the stress of its static state, which is the same at every nodal diameter of the speed."""
    if "nodes" in group.stresses:
        return group
    alike = [g.stresses["nodes"] for g in basis.groups.values() if g.speed == group.speed and "nodes" in g.stresses]
    return replace(group, stresses={"nodes": alike[0]}) if alike else group


def _sector(basis: ModalBasis, k: int) -> ModalBasis:
    """The sector at a nodal diameter as a body of its own: its eigenmodes, real parts of complex shapes."""
    groups = {}
    for (speed, harmonic), g in basis.groups.items():
        if harmonic == k:
            count = eigenmodes(g).n_modes
            stresses = {n: replace(s, stress=s.stress.real[..., :count]) for n, s in g.stresses.items()}
            groups[speed, k] = replace(eigenmodes(g), phi=g.phi.real[:, :, :count], stresses=stresses)
    return replace(basis, name=f"{basis.name}, nodal diameter {k}", groups=groups)


def _ring(basis: ModalBasis, studio: Studio, folder: Path, report: Report) -> dict[str, Path]:
    """Standing shapes of the first nodal diameters and two waves, at the lowest speed."""
    from . import ring_views

    groups = {k: g for (s, k), g in sorted(basis.groups.items()) if s == min(basis.groups)[0] and len(g.phi)}
    if not groups:
        return {}
    ring = ring_views.open_ring(basis, studio.stage)
    chosen = list(groups.values())[:RING_ROWS]
    report("pictures of the ring")
    camera = ring_views.ring_camera(ring, 0.3 * ring_views.AREA)
    image = ring_views.ring_sheet(ring, chosen, RING_COLUMNS, camera)
    body = ring_views.turning_ring(basis, chosen, RING_COLUMNS)
    sheet = save_png(image, folder / f"ring_modes_{_rpm(chosen[0])}.png", body)
    drawn, camera = {sheet.stem: sheet}, ring_views.ring_camera(ring)
    for g in [g for g in chosen if multiplicity(g.harmonic, basis.sectors) == 2][:WAVES]:
        report(f"animation of nodal diameter {g.harmonic}")
        path = save_gif(ring_views.ring_wave(ring, g, 0, camera), folder / f"ring_wave_nd{g.harmonic:02d}.gif")
        drawn[path.stem] = path
    return drawn


def _rpm(group: ModalGroup) -> str:
    return f"{to_rpm(group.speed):.6g}rpm"


def _animations(studio: Studio, group: ModalGroup, folder: Path) -> dict[str, Path]:
    from . import views

    drawn = {}
    camera = views.mode_camera(studio, [group], ANIMATED + group.kind.count("rigid"), 0.45 * views.AREA)
    for j in [j for j in range(group.n_modes) if group.kind[j] != "rigid"][:ANIMATED]:
        path = save_gif(views.animation(studio, group, j, camera), folder / f"animation_{j + 1:02d}.gif")
        drawn[path.stem] = path
    return drawn
