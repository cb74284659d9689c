"""Every picture and every measured table of docs/, made by microslip's own functions: `make docs` (some minutes).

    python docs/make_pictures.py [STUDY ...]       all studies, or the named ones (those of STUDIES below)

Products go to build/docs; a study whose inputs have not changed takes its modal files from there.
"""

from __future__ import annotations

import contextlib
import csv
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import damper_study
import numpy as np
import scipy.linalg
from pages import (
    FILES,
    HERE,
    figure_states,
    file_reference,
    fill,
    keywords,
    modal_reference,
    play,
    public_reference,
    table,
    wall,
)

from microslip.basis import read_basis
from microslip.case import CaseSettings, load_case, run_case
from microslip.case.contacts import sized
from microslip.case.settings import ContactSettings
from microslip.cli import main as typed
from microslip.data import Array, ModalBasis, ModalGroup, SpeedRange
from microslip.modal.campbell import track_basis
from microslip.modal.compute import modal_basis
from microslip.modal.speed_range import frequencies_over
from microslip.pictures import diagrams, lettering, operating, plots, views
from microslip.pictures.points import points_sheet
from microslip.pictures.response import response_picture
from microslip.pictures.scene import quiet_vtk
from microslip.reduced import truncation
from microslip.reduced.compliance import contact_share, without_bulk
from microslip.reduction import METHODS
from microslip.stages.closure import closure_stage
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage
from microslip.stages.modal import modes_stage
from microslip.stages.running import compare_book
from microslip.verbs import optimum as lowest

ROOT = HERE.parent
BUILD = ROOT / "build" / "docs"
PICTURES = HERE / "pictures"
LIGHT = ("output.gauss=false", "output.nodal_stress=false")
COARSE_SHROUD = (
    "mesh.size=12", "mesh.local={pressure_side=7, suction_side=7, contact_left=5, contact_right=5}",
    "cyclic.nodal_diameters=[0]", "closures=[]",
)  # fmt: skip
AT_REST = ("rotation.speeds_rpm=[0.0]", "cyclic.nodal_diameters=[0]", "closures=[]", 'reduction="eigenmodes"')
PRINTED_FREE, PRINTED_STUCK = (14.1, 159.55, 540.61), (120.0, 320.0, 470.0)
SPRINGS = ("normal_stiffness", "tangential_stiffness")
TORSION = (0, 2, 6)  # the modes of the free blade that section 5.3 prints: first bending, first and second torsion


def made(name: str, body: str, *changes: str) -> ModalBasis:
    """The modal file of a body with some settings changed, under a name of its own."""
    job = open_job(ROOT / "geometry" / body, [f'name="{name}"', *changes], BUILD)
    return read_basis(modes_stage(job)[0])


LINES = 64
"""Colours that drawings of lines need."""


def save(image: Any, name: str, smooth: bool = False, colours: int = 256) -> None:
    """A PNG of so many colours whose palette covers rare ones too, or of all where they blend (smooth)."""
    from PIL import Image

    flat = image.convert("RGB")
    if not smooth:
        flat = flat.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=4, dither=Image.Dither.NONE)
    flat.save(PICTURES / f"{name}.png", optimize=True)


def figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def drawn(fig: Any) -> Any:
    """A matplotlib figure as a Pillow image."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(fig)
    canvas.draw()
    return lettering.picture(np.asarray(canvas.buffer_rgba()))


def picture(draw: Any, *what: Any, **how: Any) -> Any:
    """What a function of `microslip.pictures` draws of something, as a Pillow image."""
    return drawn(plots.figure_of(partial(draw, *what, **how)))


def plain(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#dde0e6", linewidth=0.7)
    axes.set_axisbelow(True)


def from_file(path: Path) -> Any:
    from PIL import Image

    return Image.open(path)


def percent(value: float, printed: float) -> str:
    return f"{100 * (value / printed - 1):+.2f} %"


# the bodies --------------------------------------------------------------------------------------------------------


def geometry() -> None:
    """A picture of each body with its named faces, and a table of what each is."""
    rows = []
    for body in ("blade", "shroud", "pendulum", "half-pipe"):
        still = AT_REST if body == "shroud" else ()
        basis = made(body, body, *LIGHT, *still)
        with_studio(basis, lambda s, body=body: save(views.mesh_picture(s), body, colours=2 * LINES))
        group = basis.groups[0, 0]
        lowest = group.frequency[group.kind.index("normal")]
        size = " x ".join(f"{v:.4g}" for v in np.ptp(basis.mesh.points, axis=0) * 1e3)
        rows.append([f"`{body}`", size, f"{basis.mass:.4g}", basis.mesh.n_points, basis.mesh.n_cells, f"{lowest:.2f}"])
    head = ["body", "size in mm (x, y, z)", "mass in kg", "points", "cells", "first elastic frequency in Hz"]
    fill("geometry.md", "bodies", table(head, rows))
    designs()


COMPANIONS = {
    "rig-neighbour": "rig-neighbour", "pin": "pin", "pin-blade": "pin-blade", "wire": "wire",
    "wire-blade": "wire-blade", "pit-blade": "pit-blade", "damper": "damper",
    "damper-cylinder": "damper/cylinder.toml", "damper-asymmetric": "damper/asymmetric.toml",
}  # fmt: skip
WARM, COOL = (236, 158, 60), (176, 186, 202)


def meeting() -> None:
    """The bodies made to touch others: a table of what each is, and pictures of them where they meet."""
    rows, bodies = [], {name: made(name, path, *LIGHT) for name, path in COMPANIONS.items()}
    for name, basis in bodies.items():
        group = basis.groups[0, 0]
        lowest = group.frequency[group.kind.index("normal")]
        size = " x ".join(f"{v:.4g}" for v in np.ptp(basis.mesh.points, axis=0) * 1e3)
        shapes = f"{group.n_modes}" + (", free" if basis.free else "")
        rows.append([f"`{name}`", size, f"{basis.mass:.4g}", basis.mesh.n_points, shapes, f"{lowest:.5g}"])
    head = ["body", "size in mm (x, y, z)", "mass in kg", "points", "coordinates", "first elastic frequency in Hz"]
    fill("geometry.md", "companions", table(head, rows))
    tiles = [
        lettering.captioned(picture, title, size=15)
        for title, picture in (
            ("pin in two blade tips", pins(bodies)), ("wire through seven blades", wires(bodies)),
        )
    ]  # fmt: skip
    tiles += [
        lettering.captioned(dampers(bodies, name), name, size=15)
        for name in ("damper", "damper-cylinder", "damper-asymmetric")
    ]
    save(lettering.stacked([lettering.side_by_side(tiles[:2], 30), lettering.side_by_side(tiles[2:], 20)]), "meeting")


def placed(stage: Any, basis: ModalBasis, turn: int, blades: int, colour: Any, opacity: float = 1.0) -> np.ndarray:
    """Put a body on the stage, turned by some pitches about the rotor axis; its points there."""
    from microslip.pictures.scene import surface

    R = turned_about_y(turn * 2 * np.pi / blades)
    outside = surface(basis.mesh)
    points = basis.mesh.points @ R.T
    stage.skin(points[outside.source], outside.triangles, color=colour, opacity=opacity)
    stage.lines(points, outside.outline, (70, 74, 84), 1.2)
    return points


def pins(bodies: dict[str, ModalBasis]) -> Any:
    from microslip.pictures.scene import axes_towards, fit_tile

    def draw(studio: views.Studio) -> Any:
        studio.stage.clear()
        for turn in (0, 1):
            placed(studio.stage, bodies["pin-blade"], turn, 24, COOL, 0.45)
        points = placed(studio.stage, bodies["pin"], 0, 24, WARM)
        middle = points.mean(axis=0)
        frame = middle + 0.075 * np.array([[-1, -1, -1.2], [1, 1, 0.6], [-1, 1, 0.6], [1, -1, -1.2]])
        return studio.stage.shoot(fit_tile(frame, axes_towards(np.array([0.35, -1.0, 0.55])), (520, 400)))

    return with_studio(bodies["pin"], draw)


def wires(bodies: dict[str, ModalBasis]) -> Any:
    from microslip.pictures.scene import axes_towards, fit_tile

    def draw(studio: views.Studio) -> Any:
        studio.stage.clear()
        turns = range(-3, 4)
        found = [placed(studio.stage, bodies["wire-blade"], turn, 28, COOL) for turn in turns]
        found.append(placed(studio.stage, bodies["wire"], 0, 28, WARM))
        axes = axes_towards(np.array([0.15, -1.0, 0.25]))
        return studio.stage.shoot(fit_tile(np.vstack(found), axes, (620, 400)))

    return with_studio(bodies["wire"], draw)


def dampers(bodies: dict[str, ModalBasis], name: str) -> Any:
    """Seen along the rotor axis, as if one looked through the blades."""
    from microslip.pictures.scene import axes_towards, fit_tile

    def draw(studio: views.Studio) -> Any:
        studio.stage.clear()
        for turn in (0, 1):
            placed(studio.stage, bodies["pit-blade"], turn, 30, COOL)
        points = placed(studio.stage, bodies[name], 0, 30, WARM)
        out = turned_about_y(np.pi / 30) @ [0, 0, 1]
        middle = points.mean(axis=0) + 0.002 * out
        frame = middle + 0.02 * np.array([[-1, 0, -1], [1, 0, 1], [-1, 0, 1], [1, 0, -1]])
        axes = axes_towards(np.array([0.0, -1.0, 0.0]), out)
        return studio.stage.shoot(fit_tile(frame, axes, (370, 300)))

    return with_studio(bodies[name], draw)


def with_studio(basis: ModalBasis, draw: Any) -> Any:
    quiet_vtk()
    studio = views.open_studio(basis)
    try:
        return draw(studio)
    finally:
        studio.stage.close()


def designs() -> None:
    """Top views of the two shroud designs between their neighbours."""
    tiles = []
    for design, title in ((1, "design = 1, shroud_angle = 30"), (2, "design = 2, shroud_angle = 60")):
        own = () if design == 1 else ("geometry.parameters.shroud_angle=60", "geometry.parameters.contact_width=20")
        change = (f"geometry.parameters.design={design}", *own, "rotation.speeds_rpm=[0.0]", "modes.count=2")
        basis = made(f"shroud-design-{design}", "shroud", *COARSE_SHROUD, *change, *LIGHT)
        tiles.append(lettering.captioned(with_studio(basis, top_view), title, size=16))
    note = "Seen from outside, with both neighbours; x to the right, y upwards. Contacts: orange left, green right."
    row = lettering.side_by_side(tiles, 30)
    save(lettering.captioned(row, "shroud: the two designs", note, 20), "shroud_designs")


def top_view(studio: views.Studio) -> Any:
    """The shroud plates of three blades from outside; contacts as thick lines."""
    from microslip.pictures.scene import fit

    outside, mesh, stage = studio.outside, studio.basis.mesh, studio.stage
    high = studio.points[outside.triangles][:, :, 2].min(axis=1) > 0.395
    plate = outside.triangles[high]
    edges = outside.outline[(mesh.points[outside.outline][:, :, 2] > 0.395).all(axis=1)]
    camera = fit(mesh.points[np.unique(edges)] * [2.2, 1.15, 1], np.eye(3), 150_000, (0.4, 4.0))
    stage.clear()
    for side, colour in ((-1, (228, 231, 236)), (1, (228, 231, 236)), (0, (190, 196, 206))):
        turn = turned_about_y(side * 2 * np.pi / 24)
        stage.skin(studio.points @ turn.T, plate, color=colour)
        stage.lines(mesh.points @ turn.T + [0, 0, 0.004], edges, (60, 64, 74), 1.5)
    for name, colour in (("left", (240, 120, 10)), ("right", (30, 140, 40))):
        item = studio.basis.groups[0, 0].interfaces[name]
        along = np.sort((item.points - item.origin) @ item.rotation[1])[[0, -1]]
        ends = item.origin + along[:, None] * item.rotation[1] + [0, 0, 0.02]
        stage.lines(ends, np.array([[0, 1]]), colour, 7.0)
    return stage.shoot(camera)


def turned_about_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


# dampers ---------------------------------------------------------------------------------------------------------


def companion(name: str) -> ModalBasis:
    return made(name, COMPANIONS[name], *LIGHT)


def damping_element() -> None:
    """24 blades coupled by pins: bending and torsion over frequency and normal force, engine orders, sensitivity."""
    built = damper_study.opened("damping-element", companion)
    frequency = np.concatenate([np.linspace(14, 40, 27), np.linspace(44, 184, 36)])
    forces = (20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 120.0, 160.0, 240.0, 400.0, 1000.0)
    curves = damper_study.over_forces(built, forces, frequency)
    orders = range(1, 13)
    by_order = {e: damper_study.of_order(built, e) for e in orders}
    wide = np.linspace(20, 250, 93)
    along = {e: damper_study.followed(damper_study.problem_of(b, 100.0), wide) for e, b in by_order.items()}
    fig = figure(8.6, 6.4)
    (a, b), (c, d) = fig.subplots(2, 2)
    bending, torsion = damper_study.bending, damper_study.torsion
    for axes, pick, what in ((a, bending, "bending, tip in mm"), (b, torsion, "torsion of the tip in mrad")):
        plain(axes)
        for force, colour in zip((30.0, 50.0, 80.0, 160.0, 1000.0), plots.COLOURS, strict=False):
            x = curves[force]
            axes.semilogy(x.frequency, 1e3 * np.abs(pick(x.outputs)), color=colour, label=f"{force:g} N")
        axes.set(xlabel="frequency in Hz", ylabel=what)
    a.legend(fontsize=8, title="normal force", title_fontsize=8)
    plain(c)
    for pick, what, colour in ((bending, "tip in mm", "#0b4f9c"), (torsion, "torsion in mrad", "#d98410")):
        largest = [1e3 * x.largest(pick)[1] for x in curves.values()]
        c.loglog(forces, largest, "o-", color=colour, label=what, markersize=3)
    c.set(xlabel="normal force in N", ylabel="largest amplitude up to 184 Hz")
    c.legend(fontsize=8)
    plain(d)
    d.semilogy(orders, [1e3 * along[e].largest(damper_study.bending)[1] for e in orders], "o-", color=plots.COLOURS[0])
    d.set(xlabel="engine order", ylabel="largest tip amplitude in mm, 100 N")
    save(drawn(fig), "damping_element")
    stuck = {e: damper_study.sticking(damper_study.problem_of(b, 100.0))[0] for e, b in by_order.items()}
    rows = [[f"{e}", f"{stuck[e]:.1f}", f"{along[e].largest(damper_study.bending)[0]:.0f}",
             f"{1e3 * along[e].largest(damper_study.bending)[1]:.4f}"] for e in orders]  # fmt: skip
    head = ["engine order", "sticking, Hz", "resonance at 100 N, Hz", "tip, mm"]
    fill("dampers.md", "orders", table(head, rows))
    rows = []
    for label, changes in (
        ("as in the case file", ()),
        ("friction 0.2", tuple(f"contacts.{i}.friction=0.2" for i in range(2))),
        ("friction 0.5", tuple(f"contacts.{i}.friction=0.5" for i in range(2))),
        ("tangential stiffness x 4", tuple(f"contacts.{i}.tangential_stiffness=68e6" for i in range(2))),
        ("tangential stiffness / 4", tuple(f"contacts.{i}.tangential_stiffness=4.25e6" for i in range(2))),
        ("weak springs 10 Hz", ("bodies.pin.weak_springs=10.0",)),
        ("weak springs 60 Hz", ("bodies.pin.weak_springs=60.0",)),
        ("force 20 N", ("excitations.0.amplitude=20.0",)),
    ):  # fmt: skip
        found = damper_study.opened("damping-element", companion, *changes)
        few = damper_study.over_forces(found, (40.0, 50.0, 60.0, 70.0, 80.0, 100.0, 120.0, 140.0, 180.0), frequency)
        best = [damper_study.optimum(few, pick) for pick in (damper_study.bending, damper_study.torsion)]
        rows.append([label, f"{best[0][0]:g}", f"{1e3 * best[0][2]:.4f}", f"{best[0][1]:.0f}", f"{best[1][0]:g}",
                     f"{1e3 * best[1][2]:.4f}"])  # fmt: skip
    head = ["", "best for bending, N", "tip, mm", "at Hz", "best for torsion, N", "torsion, mrad"]
    fill("dampers.md", "element", table(head, rows))


def damping_wire() -> None:
    """7 of 28 blades on a wire: tip over frequency, largest amplitude over normal force, sensitivity."""
    built = damper_study.opened("damping-wire", companion)
    frequency = np.linspace(62, 84, 34)
    forces = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 120.0, 250.0, 1000.0)
    curves = damper_study.over_forces(built, forces, frequency)
    fig = figure(8.6, 3.6)
    left, right = fig.subplots(1, 2)
    plain(left)
    for force, colour in zip((10.0, 20.0, 50.0, 120.0, 1000.0), plots.COLOURS, strict=False):
        x = curves[force]
        left.semilogy(x.frequency, 1e3 * np.abs(x.outputs[:, 0]), color=colour, label=f"{force:g} N")
    left.set(xlabel="frequency in Hz", ylabel="tip of blade 4 in mm")
    left.legend(fontsize=8, title="normal force", title_fontsize=8)
    plain(right)
    for number, blade in enumerate((4, 1, 7)):
        largest = [1e3 * x.largest(lambda w, n=number: w[:, n])[1] for x in curves.values()]
        right.loglog(forces, largest, "o-", color=plots.COLOURS[number], label=f"blade {blade}", markersize=3)
    right.set(xlabel="normal force in N", ylabel="largest tip amplitude in mm")
    right.legend(fontsize=8)
    save(drawn(fig), "damping_wire")
    rows = []
    for force, x in curves.items():
        tips = [f"{1e3 * x.largest(lambda w, n=n: w[:, n])[1]:.3f}" for n in range(3)]
        rows.append([f"{force:g}", f"{x.largest(damper_study.bending)[0]:.1f}", *tips])
    fill("dampers.md", "wire", table(["normal force, N", "Hz", "blade 4, mm", "blade 1, mm", "blade 7, mm"], rows))


def spin_pit() -> None:
    """30 blades with underplatform dampers: strain over frequency, and over mass for three shapes (`optimum`)."""
    frequency = np.linspace(104, 160, 57)
    all_of = {
        (s, m): damper_study.under_platforms(s, m, companion, frequency)
        for s in damper_study.SHAPES
        for m in damper_study.PRINTED
    }
    fig = figure(8.6, 3.6)
    left, right = fig.subplots(1, 2)
    plain(left)
    for mass, colour in zip(damper_study.PRINTED, plots.COLOURS, strict=False):
        _, x = all_of["cottage-roof", mass]
        strain, valid = 1e6 * np.abs(x.outputs[:, 0]), np.array([not x.lifts(f) for f in x.frequency])
        left.semilogy(x.frequency, strain, ":", color=colour, linewidth=1.2)
        left.semilogy(x.frequency, np.where(valid, strain, np.nan), color=colour, label=f"{1e3 * mass:g} g")
    left.set(xlabel="frequency in Hz", ylabel="strain amplitude in µm/m", title="cottage roof")
    left.legend(fontsize=8)
    over_mass = {shape: strain_over_mass(shape) for shape in damper_study.SHAPES}
    plain(right)
    for (shape, (mass, strain, valid)), colour in zip(over_mass.items(), plots.COLOURS, strict=False):
        best = strain.argmin()
        right.loglog(1e3 * mass, 1e6 * strain, "o:", color=colour, mfc="white", markersize=3, linewidth=1)
        right.plot(1e3 * mass, np.where(valid, 1e6 * strain, np.nan), "o-", color=colour, label=shape, markersize=3)
        right.plot(1e3 * mass[best], 1e6 * strain[best], "o", color=colour, mfc="none", markersize=9)
    right.set(xlabel="damper mass in g", ylabel="largest strain amplitude in µm/m", title="rings: lowest")
    right.set_xticks([16, 26, 42, 75, 117], labels=["16", "26", "42", "75", "117"], minor=False)
    right.set_xticks([], minor=True)
    right.legend(fontsize=8)
    for axes in (left, right):
        plots.numbers_within(axes.yaxis)
    save(drawn(fig), "spin_pit")
    rows = []
    for (shape, mass), (normal, x) in all_of.items():
        f, strain = x.largest(damper_study.bending)
        doubt = "not valid: contacts would lift off" if x.lifts(f) else ""
        rows.append([shape, f"{1e3 * mass:g}", f"{normal:.0f}", f"{f:.1f}", f"{1e6 * strain:.0f}", doubt])
    head = ["damper", "mass, g", "normal force, N", "resonance, Hz", "strain, µm/m", "validity"]
    fill("dampers.md", "pit", table(head, rows))
    best = []
    for shape, (m, strain, valid) in over_mass.items():
        i = strain.argmin()
        best.append([shape, f"{1e3 * m[i]:.1f}", f"{1e6 * strain[i]:.0f}", "" if valid[i] else lowest.NOT_VALID])
    fill("dampers.md", "mass", table(["damper", "best mass, g", "largest strain there, µm/m", "validity"], best))


def strain_over_mass(shape: str) -> tuple[Array, Array, Array]:
    """Masses (kg) of a damper's shape, the largest strains that `microslip optimum` finds, and which are valid."""
    asked = f"optimum {damper_study.CASES}/spin-pit-{shape}.toml --over bodies.damper.mass --low 0.0165 --high 0.16"
    with contextlib.chdir(BUILD):  # where `companion` has left the bodies
        typed([*asked.split(), "--points", "9"])
    text = (BUILD / f"build/spin-pit-{shape}/optimum.csv").read_text(encoding="utf-8")
    rows = [row for row in csv.DictReader(text.splitlines()) if row["what"].startswith(lowest.RESONANCE)]
    mass, strain = (np.array([float(row[k]) for row in rows]) for k in ("bodies.damper.mass_kg", "amplitude_strain"))
    return mass, strain, np.array([lowest.NOT_VALID not in row["what"] for row in rows])


# static contact ----------------------------------------------------------------------------------------------------


def closure() -> None:
    """Normal force of the shroud over speed and interference, and the pressure on its face."""
    rpm = [0.0, 1500.0, 3000.0, 4500.0, 6000.0]
    few = ("modes.count=2", "cyclic.nodal_diameters=[0]", f"rotation.speeds_rpm={rpm}")
    rows, curves, shown = [], {}, None
    for interference in (-0.2, 0.0, 0.2, 0.5):
        closed = 'name="shroud", face="contact_right", against="contact_left", sector_shift=1'
        name = f"shroud-closed-{interference:g}".replace(".", "-").replace("--", "-gap-")
        settings = f"closures=[{{{closed}, interference={interference}}}]"
        basis = made(name, "shroud", *COARSE_SHROUD, *LIGHT, *few, settings)
        states = [basis.groups[i, 0].contacts["shroud"] for i in range(len(rpm))]
        curves[interference] = [c.normal_force for c in states]
        forces = [f"{c.normal_force:.1f}" for c in states]
        rows.append([f"{interference:g}", *forces, percent_of(states[-1].closed_share)])
        shown = basis if interference == 0.2 else shown
    head = ["interference in mm", *(f"{r:g} rpm" for r in rpm), f"area in contact at {rpm[-1]:g} rpm"]
    fill("contact_statics.md", "closure", table(head, rows))
    fig = figure(7.2, 4.0)
    axes = fig.subplots()
    plain(axes)
    for (interference, forces), colour in zip(curves.items(), plots.COLOURS, strict=False):
        axes.plot(rpm, forces, "o-", color=colour, label=f"{interference:g} mm")
    axes.set(xlabel="rpm", ylabel="normal force of one contact in N", ylim=(0, None))
    axes.legend(title="interference (negative: gap)", fontsize=9)
    save(drawn(fig), "closure_force")
    assert shown is not None
    shown = replace(shown, name="shroud, interference 0.2 mm")
    save(picture(plots.closure_plot, shown), "closure_pressure")


def closed() -> None:
    """Nodal diameters of the shroud whose neighbours press on each other along the normal, free to slide."""
    from microslip.pictures import diagrams

    pressed = ('closures.shroud.modes="closed"', "rotation.speeds_rpm=[4500]")
    basis = replace(made("shroud-closed", "shroud", *LIGHT, *pressed), name="shroud, contacts closed")
    plots.save(partial(diagrams.stuck_plot, basis), BUILD / "closed_nodal_diameters.png")
    save(from_file(BUILD / "closed_nodal_diameters.png"), "closed_nodal_diameters")


def contact_stiffness() -> None:
    """The shroud pressed step by step at speed: the picture of the verb `closure`."""
    chosen = (*COARSE_SHROUD[:2], "rotation.speeds_rpm=[3000.0]")
    job = open_job(ROOT / "geometry" / "shroud", ['name="shroud"', *chosen], BUILD)
    save(from_file(closure_stage(job, None, -0.2, 0.8, 6, 3000.0).files[-1]), "closure_curve")


def bolts() -> None:
    """The half pipe pressed by its bolts: pressure round them, and its modes with the joint open and closed."""
    few = (*LIGHT, "modes.count=9")
    faces = [*(f"bolt_{i}" for i in range(1, 13)), "seam_right", "seam_left"]
    plane = 'against="ground", point=[0.0, 0.0, 0.0], normal=[0.0, 0.0, 1.0], modes="closed"'
    closed = ", ".join(f'{{name="{f}", face="{f}", {plane}}}' for f in faces)
    variants = {
        "without preload, free": ("loose", "bolts=[]", "closures=[]"),
        '`modes = "open"`': ("open",),
        '`modes = "closed"`': ("closed", f"closures=[{closed}]"),
    }
    rows = []
    for title, (name, *changes) in variants.items():
        basis = made(f"half-pipe-{name}", "half-pipe/preloaded.toml", *few, *changes)
        group = basis.groups[0, 0]
        rigid = group.kind.count("rigid")
        found = [f"{f:.2f}" for f in group.frequency[rigid : rigid + 3]]
        rows.append([title, rigid, *found])
        if name == "open":
            bolt_picture(group)
    head = ["modes", "rigid motions", "first in Hz", "second", "third"]
    fill("contact_statics.md", "bolts", table(head, rows))


def bolt_picture(group: ModalGroup) -> None:
    """Pressure on the first patch of a flange, and over the distance from the bolt on all of them."""
    fig = figure(9.6, 5.0)
    left, right = fig.subplots(1, 2, width_ratios=[4, 5])
    c = group.contacts["bolt_1"]
    x, y = 1e3 * c.points[:, :2].T
    order = np.argsort(c.pressure, kind="stable")
    shown = left.scatter(
        x[order], y[order], s=26, c=1e-6 * c.pressure[order], cmap="YlOrRd", vmin=0, edgecolors="#8a929c",
        linewidths=0.3,
    )  # fmt: skip
    ring = np.linspace(0, 2 * np.pi, 90)
    for radius, style in ((8, "-"), (16, "--")):
        left.plot(65 + radius * np.cos(ring), -250 + radius * np.sin(ring), style, color="#3b6fb6", linewidth=1.4)
    left.set(xlabel="x in mm, across the flange", ylabel="y in mm, along the pipe", aspect="equal")
    left.set(xlim=(51, 79), ylim=(-272, -228))
    left.set_title("patch bolt_1; blue: washer, cone", fontsize=10)
    fig.colorbar(shown, ax=left, label="pressure in MPa", location="right", shrink=0.8)
    plain(right)
    for i in range(1, 13):
        c = group.contacts[f"bolt_{i}"]
        middle = np.array([65.0 if i < 7 else -65.0, 100 * ((i - 1) % 6 - 2.5)])
        distance = np.linalg.norm(1e3 * c.points[:, :2] - middle, axis=1)
        right.plot(distance, 1e-6 * c.pressure, ".", color=plots.COLOURS[0], markersize=2.5, alpha=0.5)
    for radius, text in ((8, "washer"), (16, "cone of 45 degrees")):
        right.axvline(radius, color="#8a929c", linewidth=1)
        right.text(radius + 0.3, 0.97, text, transform=right.get_xaxis_transform(), fontsize=9, va="top")
    right.set(xlabel="mm from the axis of the bolt", ylabel="pressure in MPa", xlim=(4, 24), ylim=(0, None))
    right.set_title("all twelve patches", fontsize=10)
    save(drawn(fig), "bolt_pressure")


def percent_of(share: float) -> str:
    return f"{100 * share:.1f} %"


# the blade of section 5.3 ------------------------------------------------------------------------------------------


def convergence() -> None:
    """Frequencies of the free blade over the element size."""
    sizes = (24, 16, 12, 8, 6, 4.5)
    runs = [made(f"blade-{s:g}", "blade", *LIGHT, f"mesh.size={s}", "modes.count=10") for s in sizes]
    f = np.array([b.groups[0, 0].frequency[list(TORSION)] for b in runs])
    n = [3 * b.mesh.n_points for b in runs]
    rows = [[f"{s:g}", k, *(f"{v:.3f}" for v in row)] for s, k, row in zip(sizes, n, f, strict=True)]
    rows.append(["printed", "", *(f"{v:g}" for v in PRINTED_FREE)])
    rows.append(["finest against printed", "", *(percent(v, p) for v, p in zip(f[-1], PRINTED_FREE, strict=True))])
    head = ["element size in mm", "degrees of freedom", "bending 1, Hz", "torsion 1, Hz", "torsion 2, Hz"]
    fill("blade.md", "convergence", table(head, rows))
    fig = figure(7.2, 4.2)
    axes = fig.subplots()
    plain(axes)
    for i, (name, colour) in enumerate(zip(("bending 1", "torsion 1", "torsion 2"), plots.COLOURS, strict=False)):
        axes.loglog(n[:-1], 100 * (f[:-1, i] / f[-1, i] - 1), "o-", color=colour, label=f"{name}, {f[-1, i]:.2f} Hz")
    for k, s, y in zip(n[:-1], sizes[:-1], 100 * (f[:-1] / f[-1] - 1).max(axis=1), strict=True):
        axes.annotate(f"{s:g} mm", (k, y), xytext=(4, 6), textcoords="offset points", fontsize=9, color="#5b6270")
    axes.set_xlabel("degrees of freedom")
    axes.set_ylabel(f"above the mesh of {sizes[-1]:g} mm, in %")
    axes.legend(fontsize=9)
    save(drawn(fig), "blade_convergence")


def blade_case(basis: ModalBasis, **changes: Any) -> CaseSettings:
    settings, _ = load_case(ROOT / "pipeline" / "cases" / "blade.toml")
    group = basis.groups[0, 0]
    own = tuple(sized(c, group.interfaces[c.interface]) for c in settings.contacts)
    return settings.model_copy(update={"contacts": own, **changes})


def stuck(group: ModalGroup, settings: CaseSettings) -> np.ndarray:
    K = group.K_r.copy()
    for c in settings.contacts:
        rows = group.interfaces[c.interface].rows
        K += rows.T @ (springs_of(c)[:, None] * rows)
    return np.sqrt(scipy.linalg.eigvalsh(K, group.M_r)[:4]) / (2 * np.pi)


def springs_of(c: ContactSettings) -> np.ndarray:
    """(6,) springs of a patch along u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2 (Sextro Eqs. (5.2-39) to (5.2-41))."""
    n, t, b2, h2 = c.normal_stiffness, c.tangential_stiffness, (c.width or 0.0) ** 2 / 12, (c.height or 0.0) ** 2 / 12
    return np.array([n, t, t, t * (b2 + h2), n * h2, n * b2])


def contact() -> None:
    """The blade between its neighbours: sticking frequencies against the printed ones, the friction response."""
    basis = made("blade", "blade", *LIGHT)
    result = run_case(blade_case(basis), basis)
    rows = [
        [name, f"{p:g}", f"{v:.1f}", percent(v, p)]
        for name, p, v in zip(("bending", "bending", "torsion"), PRINTED_STUCK, result.stuck, strict=False)
    ]
    fill("blade.md", "stuck", table(["resonance", "printed, Hz", "sticking contacts, Hz", "deviation"], rows))
    rows = []
    for normal, found in sorted(result.resonances.items(), reverse=True):
        f, a = max(found, key=lambda p: p[1])
        open_ = result.responses[normal].open.max()
        rows.append([f"{normal:g}", f"{f:.1f}", f"{1e6 * a:.1f}", f"{100 * open_:.2g}"])
    head = ["F_N, N", "resonance, Hz", "amplitude, µm", "points times cycle that are open at most, %"]
    fill("blade.md", "peaks", table(head, rows))
    PICTURES.mkdir(exist_ok=True)
    save(picture(response_picture, result), "blade_response")
    with_studio(basis, lambda s: save(mode_sheet(s, (0, 1, 2, 4, 6), 0.6), "blade_modes"))


def mode_sheet(studio: views.Studio, chosen: Sequence[int], factor: float) -> Any:
    """Some modes in one row."""
    group = studio.basis.groups[0, 0]
    camera = views.mode_camera(studio, [group], max(chosen) + 1)
    images = list(views.mode_pictures(studio, group, max(chosen) + 1, camera))
    small = {j: lettering.scaled(images[j], factor) for j in chosen}
    tiles = [lettering.captioned(image, views.mode_title(group, j), size=16) for j, image in small.items()]
    row = lettering.side_by_side(tiles, 4)
    return lettering.captioned(row, "", "Amplified to the same largest displacement; grey lines: at rest.", 18)


def sensitivity() -> None:
    """What the assumptions of the blade case are worth."""
    basis = made("blade", "blade", *LIGHT)
    group, settings = basis.groups[0, 0], blade_case(basis)
    base = stuck(group, settings)
    rows = [["as in the case file", *(f"{v:.1f} Hz" for v in base[:3])]]

    def row(text: str, values: np.ndarray) -> None:
        rows.append([text, *(percent(v, b) for v, b in zip(values[:3], base[:3], strict=True))])

    for key, text in zip(SPRINGS, ("normal stiffness", "tangential stiffness"), strict=True):
        for factor in (0.8, 1.2):
            changed = with_contacts(settings, lambda c, k=key, f=factor: {k: f * getattr(c, k)})
            row(f"{text} {100 * (factor - 1):+.0f} %", stuck(group, changed))
    row("both a tenth", stuck(group, with_contacts(settings, lambda c: {k: 0.1 * getattr(c, k) for k in SPRINGS})))
    row("no rotational spring about t1", stuck(group, with_contacts(settings, lambda c: {"height": 1e-6})))
    for text, change in (
        ("60 modes instead of 20", "modes.count=60"), ("element size 6 mm instead of 8", "mesh.size=6"),
        ("blade 1 % shorter", "geometry.parameters.blade_length=470.25"),
        ("blade 1 % thicker", "geometry.parameters.thickness=5.05"),
        ("Young's modulus -1 %", "material.young=2.079e11"),
    ):  # fmt: skip
        name = "blade-" + "".join(c if c.isalnum() else "-" for c in change.split(".")[-1])
        row(text, stuck(made(name, "blade", *LIGHT, change).groups[0, 0], settings))
    fill("blade.md", "sensitivity", table(["change", "bending 1", "bending 2", "torsion"], rows))
    amplitudes(basis, settings)


def with_contacts(settings: CaseSettings, change: Any) -> CaseSettings:
    """The case with every contact changed by what `change` (contact -> keys) says."""
    contacts = (type(c).model_validate(c.model_dump(exclude_unset=True) | change(c)) for c in settings.contacts)
    return settings.model_copy(update={"contacts": tuple(contacts)})


def amplitudes(basis: ModalBasis, settings: CaseSettings) -> None:
    """First resonance at 780 N and 100 N for other excitation heights and dampings."""
    band = {"start": 105.0, "stop": 125.0, "points": 41, "normal_forces": (100.0, 780.0)}
    near = settings.sweep.model_copy(update=band)
    rows = []

    def row(text: str, b: ModalBasis) -> None:
        result = run_case(settings.model_copy(update={"sweep": near}), b)
        best = [max(found, key=lambda p: p[1]) for found in result.resonances.values()]
        rows.append([text, *(f"{1e6 * a:.0f} µm at {f:.2f} Hz" for f, a in best)])

    row("as in the files: 285 mm, D = 0.1 %", basis)
    for height in (237.5, 332.5):
        at = [f"excitations.magnet.point=[2.5,30,{height}]", f"monitors.accelerometer.point=[2.5,30,{height}]"]
        row(f"excitation and accelerometer at {height:g} mm", made(f"blade-at-{height:g}", "blade", *LIGHT, *at))
    group = basis.groups[0, 0]
    for ratio in (0.0005, 0.002):
        damped = replace(group, damping_ratio=np.full(group.n_modes, ratio), C_r=np.diag(2 * ratio * group.omega))
        row(f"D = {100 * ratio:g} %", replace(basis, groups={(0, 0): damped}))
    fill("blade.md", "amplitudes", table(["change", "F_N = 100 N", "F_N = 780 N"], rows))


def arrangement2() -> None:
    """The second arrangement: contacts turned, bending tangential."""
    change = ("geometry.parameters.arrangement=2", "interfaces.right.t2=[0,0,1]", "interfaces.left.t2=[0,0,1]")
    basis = made("blade-arrangement-2", "blade", *LIGHT, *change)
    settings = blade_case(basis)
    stiff = dict(zip(SPRINGS, (7.6e9, 2.9e9), strict=True)) | {"width": 0.020, "friction": 0.4}
    values = stuck(basis.groups[0, 0], with_contacts(settings, lambda _: stiff))
    text = ", ".join(f"{v:.1f}" for v in values[:3])
    fill("blade.md", "arrangement2", f"With sticking contacts: {text} and {values[3]:.1f} Hz.")


def first() -> None:
    """README's first screen: three modes of the free blade, and the friction response between its neighbours."""
    basis = made("blade", "blade", *LIGHT)
    result = run_case(blade_case(basis), basis)
    left = with_studio(basis, three_modes)
    fig = figure(7.2, left.height / 110)
    axes = fig.subplots()
    plain(axes)
    free = result.free
    axes.semilogy(free.frequency, 1e6 * np.abs(free.monitor), color="0.55", lw=1.2, ls="--", label="free blade")
    for colour, (normal, r) in zip(plots_colours(len(result.responses)), result.responses.items(), strict=True):
        solved = np.column_stack([r.frequency, r.columns()["amplitude_m"]])
        points = np.vstack([solved, result.resonances[normal]])
        f, a = points[points[:, 0].argsort()].T
        plots.lighter(axes, f, 1e6 * a, result.unsure(normal, f), color=colour, lw=2.0, label=f"{normal:g} N")
    axes.set_xlim(90, 130)
    axes.set_ylim(2, 2500)
    axes.set_xlabel("excitation frequency in Hz", fontsize=12)
    axes.set_ylabel("amplitude at the accelerometer in µm", fontsize=12)
    axes.legend(title="normal force", fontsize=10.5, title_fontsize=10.5, ncols=1, framealpha=0.95, loc="upper right")
    parts = [
        lettering.captioned(left, "Modes of the free blade", size=22),
        lettering.captioned(drawn(fig), "Friction response to 1 N between two neighbours", size=22),
    ]
    save(lettering.side_by_side(parts, 30), "first", smooth=True)


def plots_colours(count: int) -> list[Any]:
    from matplotlib import colormaps

    return [colormaps["plasma"](x) for x in np.linspace(0.0, 0.86, count)]


def three_modes(studio: views.Studio) -> Any:
    group = studio.basis.groups[0, 0]
    camera = views.mode_camera(studio, [group], 1)
    chosen = dict(zip(TORSION, ("bending", "torsion", "torsion"), strict=True))
    tiles = []
    for j, image in enumerate(views.mode_pictures(studio, group, max(chosen) + 1, camera)):
        if j in chosen:
            small = lettering.scaled(image, 640 / image.height)
            tiles.append(lettering.captioned(small, f"{group.frequency[j]:.1f} Hz {chosen[j]}", size=17))
    return lettering.side_by_side(tiles, 6)


# the stage page ----------------------------------------------------------------------------------------------------


def speed() -> None:
    """The shrouded blade at speed with the three kinds of prestress; its Campbell diagram."""
    high = (0, 3000, 4500, 6000, 9000, 12000)
    speeds = {"nonlinear": high, "linear": high, "none": (0, 3000, 4500, 6000, 7500)}
    runs = {}
    for kind, rpm in speeds.items():
        change = (f'rotation.prestress="{kind}"', f"rotation.speeds_rpm={[float(s) for s in rpm]}")
        quick = ("modes.certify=false", "output.shapes=false")
        runs[kind] = made(f"shroud-{kind}", "shroud", *COARSE_SHROUD, *LIGHT, *quick, *change)
    speed_table(runs, speeds)
    speed_picture(runs, speeds)
    basis = made("shroud-campbell", "shroud", *COARSE_SHROUD, *LIGHT, "rotation.speeds_rpm=[0, 1500, 3000, 4500]")
    tracks = track_basis(basis)
    assert tracks is not None
    save(picture(diagrams.campbell_plot, replace(basis, name="shroud"), tracks, [2, 4, 6, 8]), "campbell")


def speed_table(runs: dict[str, ModalBasis], speeds: dict[str, Sequence[int]]) -> None:
    def f(kind: str, rpm: int) -> np.ndarray:
        return runs[kind].groups[speeds[kind].index(rpm), 0].frequency

    rows = []
    for j in range(6):
        row: list[Any] = [str(j + 1), f"{f('none', 0)[j]:.2f}", f"{f('none', 4500)[j]:.2f}"]
        for rpm in (4500, 9000, 12000):
            full, cheap = f("nonlinear", rpm)[j], f("linear", rpm)[j]
            row += [f"{full:.2f}", percent(cheap, full)]
        rows.append(row)
    head = ["mode", "at rest", "4500 rpm, none"]
    for rpm in (4500, 9000, 12000):
        head += [f"{rpm} rpm, nonlinear", "linear differs"]
    fill("modes.md", "speed", table(head, rows))


def speed_picture(runs: dict[str, ModalBasis], speeds: dict[str, Sequence[int]]) -> None:
    fig = figure(9.4, 4.4)
    for axes, j in zip(fig.subplots(1, 2), (0, 2), strict=True):
        plain(axes)
        for kind, style, colour in zip(runs, ("o-", "s--", "^:"), ("#0b4f9c", "#d98410", "#c8382c"), strict=True):
            f = [runs[kind].groups[i, 0].frequency[j] for i in range(len(speeds[kind]))]
            axes.plot(speeds[kind], f, style, color=colour, label=kind, markersize=5)
        axes.set_title(f"mode {j + 1}", fontsize=11)
        axes.set_xlabel("rotation speed in rpm")
        axes.set_ylim(bottom=0)
        axes.legend(title="prestress", fontsize=9, title_fontsize=9)
    fig.axes[0].set_ylabel("frequency in Hz")
    save(drawn(fig), "speed")


# the rotation page --------------------------------------------------------------------------------------------------


def rotation() -> None:
    """A hollow drum that spins: its Campbell diagram; the spin-up of the beam of Simo and Vu-Quoc."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "validation")]
    import test_spin_up as beam
    from meshes import body, pipe

    turning = {"speeds_rpm": [0.0, 8000.0, 16000.0, 24000.0, 32000.0], "axis": [0.0, 0, 1]}
    mesh = pipe("hexahedron20", (1, 12, 4), 0.018, 0.025, 0.25)
    basis = modal_basis(mesh, body(supports=[{"face": "z0"}], rotation=turning, modes={"count": 6}))
    tracks = track_basis(basis)
    assert tracks is not None
    save(picture(diagrams.campbell_plot, replace(basis, name="drum"), tracks, [1, 2]), "drum")
    times = np.linspace(0, 20, 801)
    runs = {"floating frame": beam.tip(times)[:, 1], "without stiffening": beam.tip(times, stiffened=False)[:, 1]}
    fig = figure(8.6, 3.9)
    axes = fig.subplots()
    plain(axes)
    axes.plot(times, runs["floating frame"], color="#0b4f9c", label="floating frame, 14 modes")
    axes.plot(times[::20], beam.beam_equation(times)[::20], "o", mfc="none", color="#111111", label="beam equation")
    away = np.abs(runs["without stiffening"]) < 0.8
    last = int(np.argmin(away))
    axes.plot(times[:last], runs["without stiffening"][:last], color="#c8382c", label="without stiffening")
    axes.set_ylim(-0.75, 0.1)
    axes.set_xlabel("time in s")
    axes.set_ylabel("lag of the tip in m")
    axes.legend(fontsize=9)
    save(drawn(fig), "spin_up")


def speeds() -> None:
    """One basis of the shrouded blade from rest to 12000 rpm, and its error against bodies solved for."""
    plain_modes = (*COARSE_SHROUD, *LIGHT, 'reduction="eigenmodes"', "output.shapes=false", "rotation.gyroscopic=false")
    at = [250.0 + 500 * i for i in range(24)]
    true = made("shroud-solved", "shroud", *plain_modes, f"rotation.speeds_rpm={at}")
    ranged = made("shroud-range", "shroud", *plain_modes, "rotation.speeds_rpm=[0]", "rotation.range_rpm=[0, 12000]")
    r = ranged.ranges[0]
    omega, _ = frequencies_over(r, np.array(at) * np.pi / 30)
    errors = [np.abs(w / true.groups[i, 0].omega[: r.count] - 1).max() for i, w in enumerate(omega)]
    fig = figure(9.4, 4.6)
    left, right = fig.subplots(1, 2)
    range_curves(left, r)
    plain(right)
    right.semilogy(at, errors, "o-", color="#0b4f9c", markersize=4, linewidth=1, label="against bodies solved for")
    right.semilogy(r.held_out * 30 / np.pi, r.total_error, "D", color="#d98410", label="stated, at held-out speeds")
    right.axhline(r.tolerance, color="#c8382c", linestyle="--", linewidth=1, label="tolerance")
    right.set_title("largest relative frequency error", fontsize=11)
    right.set_xlabel("rotation speed in rpm")
    right.set_ylim(1e-9, 1e-3)
    right.legend(fontsize=9, loc="lower center")
    save(drawn(fig), "speeds")
    known, solved, held = (
        ", ".join(f"{v:.0f}" for v in r.speeds[chosen] * 30 / np.pi) for chosen in (~r.held, r.solved, r.held)
    )
    rows = [
        [solved, known, held, f"{r.total_error.max():.0e}", f"{max(errors):.0e}", r.samples[0].n_modes],
    ]
    head = ["modes from rpm", "stiffness from", "held out", "error stated", "largest of 24", "coordinates"]
    fill("speeds.md", "range", table(head, rows))


def range_curves(axes: Any, r: SpeedRange) -> None:
    """Frequencies over the speed; dots where equilibria were computed, rings where they were held out."""
    plain(axes)
    omega, _ = frequencies_over(r, r.points)
    for j in range(r.count):
        axes.plot(r.points * 30 / np.pi, omega[:, j] / 2 / np.pi, color="#0b4f9c", linewidth=1.3)
    for chosen, style in ((~r.held, {"color": "#111111"}), (r.held, {"mfc": "white", "mec": "#d98410"})):
        there, _ = frequencies_over(r, r.speeds[chosen])
        x = np.repeat(r.speeds[chosen][:, None] * 30 / np.pi, r.count, axis=1)
        axes.plot(x.ravel(), there.ravel() / 2 / np.pi, "o", markersize=4, **style)
    axes.set_title("frequency in Hz", fontsize=11)
    axes.set_xlabel("rotation speed in rpm")
    axes.set_ylim(0, 3000)


def compliance() -> None:
    """How much static compliance the modes hold, for every body."""
    rows = []
    for body in ("blade", "shroud", "pendulum", "half-pipe"):
        still = AT_REST if body == "shroud" else ()
        group = made(body, body, *LIGHT, *still).groups[0, 0]
        rows.append([f"`{body}`", str(group.n_modes), truncation.verdict(group).sentence])
    fill("modes.md", "verdicts", table(["body", "modes", "verdict"], rows))
    basis = made("blade-60", "blade", *LIGHT, "modes.count=60")
    rows = []
    for c in truncation.coordinates(basis.groups[0, 0]):
        if c.label.startswith(("right u", "right +", "magnet")):
            shares = [truncation.percent(float(c.shares[k - 1])) for k in (5, 10, 20, 40, 60)]
            rows.append([c.label, f"{c.static:.3g} {c.unit}", *shares])
    fill("modes.md", "compliance", table(["force", "static compliance", "5 modes", "10", "20", "40", "60"], rows))
    save(picture(plots.compliance_plot, replace(basis, name="blade"), basis.groups[0, 0]), "compliance")


BOOK = 840e6  # N/m, the normal contact stiffness that section 5.3 prints


def counted_once() -> None:
    """Whose compliance: the shroud plate of 5.3 squeezed, its share in each basis, what a law may still hold."""
    found = [(size, *squeezed_plate(size)) for size in (12, 8, 6, 4)]
    rows = [
        [f"{size:g}", str(dofs), f"{1e-9 / soft:.4f}e9", f"{1e-9 / stiff:.4f}e9", f"{1e12 * (soft - stiff):.1f}e-12"]
        for size, dofs, soft, stiff in found
    ]
    head = ["element size, mm", "degrees of freedom", "uniform pressure, N/m", "rigid stamp, N/m", "difference, m/N"]
    fill("reduction.md", "plate", table(head, rows))
    shares_by_count()
    groups = {m: made(f"blade-{m}", "blade", *LIGHT, f'reduction="{m}"') for m in METHODS}
    law_by_method(groups)
    save(drawn(counted_picture(found)), "counted_once", colours=LINES)


def short(value: float) -> str:
    """``1.83e9``."""
    return f"{value:.3g}".replace("e+0", "e").replace("e+", "e")


def squeezed_plate(size: float) -> tuple[int, float, float]:
    """Degrees of freedom, and compliance of the squeezed plate (m/N): uniform pressure and rigid stamps."""
    job = open_job(ROOT / "geometry" / "blade", [f'name="plate-{size:g}"', f"mesh.size={size}"], BUILD)
    mesh, _ = load_mesh(job, mesh_stage(job))
    sys.path.append(str(ROOT / "tests"))
    from patch_bounds import patch_bounds

    return 3 * mesh.n_points, *patch_bounds(mesh, job.settings).squeezed("right", "left")


def shares_by_count() -> None:
    """What a law must bring at each contact besides its surface, over the number of plain eigenmodes."""
    group = made("blade-120", "blade", *LIGHT, "modes.count=120").groups[0, 0]
    chosen = {c.label: c for c in truncation.coordinates(group)}
    rows = []
    for count in (5, 10, 20, 60, 120):
        pair = chosen["right + left squeezed"]
        held = float(pair.shares[count - 1])
        alone = [chosen[f"right u_{r}"] for r in ("n", "t1", "t2")]
        springs = [1 / (c.static * (1 - float(c.shares[count - 1]))) for c in alone]
        law = 2 / (pair.static * (1 - held))
        rows.append([str(count), truncation.percent(held), *(short(k) for k in (law, *springs))])
    names = ["squeezed, at each contact", "alone u_n", "alone u_t1", "alone u_t2"]
    fill("reduction.md", "eigenmode_shares", table(["eigenmodes", "squeeze held", *(f"{n}, N/m" for n in names)], rows))


def law_by_method(bases: dict[str, ModalBasis]) -> None:
    """Per method: what the basis holds of the squeeze, what is left, what 840e6 N/m becomes, and the frequencies."""
    rows, stuck_rows = [], []
    for method, basis in bases.items():
        pair = contact_share(basis.groups[0, 0], method, "u_n", "right", "left")
        law = without_bulk(BOOK, pair)
        cells = [pair.held, pair.supplied, pair.left, pair.beyond]
        shown = ["0" if v < 1e-3 * pair.static else f"{1e9 * v:.3f}e-9" for v in cells]
        rows.append([f"`{method}`", *shown, short(law)])
        told = [case_frequencies(basis, includes) for includes in (None, "bulk+surface")]
        stuck_rows.append([f"`{method}`", *(", ".join(f"{f:.2f}" for f in found) for found in told)])
    head = ["`reduction`", "basis holds, m/N", "solver adds from the file, m/N", "left to the law (bulk), m/N"]
    head += ["law must not contain, m/N", "840e6 N/m becomes, N/m"]
    fill("reduction.md", "law", table(head, rows))
    head = ["`reduction`", "840e6 N/m as it stands, Hz", 'bulk taken out (`"bulk+surface"`), Hz']
    fill("reduction.md", "counted_stuck", table(head, stuck_rows))


def case_frequencies(basis: ModalBasis, includes: str | None) -> np.ndarray:
    """The first three frequencies of the blade of 5.3 that sticks between rigid neighbours, Hz."""
    settings = blade_case(basis)
    contacts = tuple(c.model_copy(update={"includes": includes}) for c in settings.contacts)
    sweep = settings.sweep.model_copy(update={"points": 2, "normal_forces": (780.0,)})
    return run_case(settings.model_copy(update={"contacts": contacts, "sweep": sweep}), basis).stuck[:3]


def counted_picture(found: Sequence[tuple[float, int, float, float]]) -> Any:
    """Left: one contact's compliance by who holds it. Right: both bounds over the mesh, and the bars' E A / L."""
    half, book = found[1][2] / 2, 1 / BOOK
    rest = book - 2 * half
    parts = {"this body's basis": "#0b4f9c", "neighbour's basis": "#7fb0e0", "contact law": "#d98410"}
    bars = [
        ("eigenmodes,\nthe book's law", (0, 0, book)),
        ("static modes,\nrigid neighbour", (half, 0, book - half)),
        ("static modes,\nneighbour too", (half, half, rest)),
        ("counted twice", (half, 0, book)),
    ]
    fig = figure(10.5, 3.6)
    left, right = fig.subplots(1, 2, width_ratios=(1.5, 1))
    plain(left)
    plain(right)
    for y, (_, widths) in enumerate(bars):
        start = 0.0
        for width, colour in zip(widths, parts.values(), strict=True):
            left.barh(y, 1e9 * width, left=1e9 * start, color=colour, edgecolor="white", height=0.62)
            if width > 0.15e-9:
                middle = 1e9 * (start + width / 2)
                left.text(middle, y, f"{1e9 * width:.2f}", ha="center", va="center", color="white", fontsize=11)
            start += width
        left.text(1e9 * start + 0.03, y, f"law {short(1 / widths[2])} N/m", va="center")
    left.axvline(1e9 * book, color="0.25", lw=1, ls="--", zorder=0)
    left.grid(visible=False)
    left.set_yticks(range(len(bars)), [name for name, _ in bars])
    left.invert_yaxis()
    left.set_xlim(0, 2.35)
    left.set_xlabel("normal compliance of one contact in nm/N (dashed: 1 / 840e6 N/m)")
    handles = [left.barh(0, 0, color=c) for c in parts.values()]
    left.legend(handles, list(parts), ncols=3, loc="lower center", bbox_to_anchor=(0.45, 1.0), frameon=False)
    dofs = [n for _, n, _, _ in found]
    right.semilogx(dofs, [1e-9 / s for _, _, s, _ in found], "o-", color="#0b4f9c", label="uniform pressure")
    right.semilogx(dofs, [1e-9 / s for _, _, _, s in found], "s-", color="#c8382c", label="rigid stamps")
    for value, name in ((0.91875, "E A / L, plate 77 x 5 x 88"), (0.840, "the book's 72 x 5 x 90")):
        right.axhline(value, color="0.5", lw=1, ls="--")
        right.text(dofs[-1], value + 0.002, name, ha="right", va="bottom", fontsize=9, color="0.3")
    right.set_ylim(0.83, 0.97)
    right.set_xticks([30e3, 60e3, 120e3, 200e3], ["30 000", "60 000", "120 000", "200 000"])
    right.minorticks_off()
    right.set_xlabel("degrees of freedom")
    right.set_ylabel("squeezed plate in 1e9 N/m")
    right.legend(frameon=False, fontsize=10, loc="center right", bbox_to_anchor=(1.0, 0.42))
    return fig


# reduction methods -------------------------------------------------------------------------------------------------


def reduction() -> None:
    """Contacts from soft to stiff, the price of every method, and the force in a sticking contact of the blade."""
    import reduction_study as study

    bodies = {
        "bar": (study.bar(), 1),
        "blade": (study.drawn_body("blade", BUILD, "mesh.size=16", "modes.count=10"), 3),
        "half_pipe": (study.drawn_body("half-pipe", BUILD, "mesh.size=25", "modes.count=20"), 3),
    }
    errors: dict[str, np.ndarray] = {}
    for name, ((mesh, settings), count) in bodies.items():
        s = study.studied(mesh, settings)
        exact, errors[name] = study.soft_to_stiff(s, count)
        rows = study.error_rows(exact, errors[name])
        fill("reduction.md", name, table(["spring", "full model", *study.METHODS], rows))
        if name != "bar":
            head = ["method", "coordinates", "time, eigenmodes = 1", "all contacts stuck: error of three frequencies"]
            fill("reduction.md", f"{name}_costs", table(head, study.cost_rows(s)))
    save(soft_to_stiff_picture(study, errors), "reduction_soft_to_stiff")
    sticking_force(study)


def soft_to_stiff_picture(study: Any, errors: dict[str, np.ndarray]) -> Any:
    """Error over the spring of a contact, a panel a body; errors: (springs, methods)."""
    fig = figure(11.0, 4.2)
    titles = {"bar": "bar, 5 modes", "blade": "blade of 5.3, 10 modes", "half_pipe": "half pipe of 5.7, 20 modes"}
    styles = {"macneal": "-", "massless-boundary": ":", "dual-craig-bampton": "--"}
    for axes, (name, found) in zip(fig.subplots(1, 3, sharey=True), errors.items(), strict=True):
        plain(axes)
        for colour, method, values in zip(plots.COLOURS[:6], study.METHODS, found.T, strict=True):
            label, colour = (method, "#111111") if method == "massless-boundary" else (method, colour)
            axes.loglog(study.RATIOS, np.maximum(values, 1e-10), styles.get(method, "-"), color=colour, lw=1.8,
                        label=label, marker="o", ms=3)  # fmt: skip
        axes.set_title(titles[name], fontsize=11)
        axes.set_xlabel("spring over static stiffness")
        axes.set_ylim(5e-11, 5)
    fig.axes[0].set_ylabel("largest error of the first frequencies")
    fig.legend(*fig.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=6, fontsize=10,
               frameon=False)  # fmt: skip
    return drawn(fig)


def sticking_force(study: Any) -> None:
    """Normal force in the right contact of the blade with the case's springs, and its error by basis."""
    mesh, settings = study.drawn_body("blade", BUILD, "mesh.size=16")
    chosen = {"10 modes and Rubin's vectors": ("rubin", 10), "20 eigenmodes": ("eigenmodes", 20),
              "60 eigenmodes": ("eigenmodes", 60), "reference": ("rubin", 120)}  # fmt: skip
    groups = {}
    for label, (method, count) in chosen.items():
        own = {"reduction": method, "modes": settings.modes.model_copy(update={"count": count})}
        groups[label] = study.modal_basis(mesh, settings.model_copy(update=own)).groups[0, 0]
    case, _ = load_case(ROOT / "pipeline" / "cases" / "blade.toml")
    own = [sized(c, groups["reference"].interfaces[c.interface]) for c in case.contacts]
    springs = np.concatenate([springs_of(c) for c in own])
    frequency = np.linspace(60, 1200, 2281)
    found = {label: np.abs(study.reduced_force(g, springs, frequency)) for label, g in groups.items()}
    places = np.linspace(0, len(frequency) - 1, 25).astype(int)
    full = np.abs(study.full_force(mesh, settings, springs, frequency[places]))
    reference = found.pop("reference")
    far = np.abs(reference[places] / full - 1).max()
    off = {k: np.abs(v / reference - 1) for k, v in found.items()}
    text = [f"median error {short(np.median(e))}, largest {short(e.max())} with {k}" for k, e in off.items()]
    agree = f"the reference, 120 modes and Rubin's vectors, meets the full model within {far:.0e} at the dots"
    fill("reduction.md", "force", f"Over 60 to 1200 Hz: {'; '.join(text)}; {agree}.")
    save(force_picture(frequency, found, reference, frequency[places], full), "reduction_force")


def force_picture(
    f: np.ndarray, found: dict[str, np.ndarray], reference: np.ndarray, at: np.ndarray, full: np.ndarray
) -> Any:
    fig = figure(11.0, 4.4)
    left, right = fig.subplots(1, 2)
    colours = ("#0b4f9c", "#d98410", "#4a8f3a")
    for (label, values), colour, style in zip(found.items(), colours, ("-", "--", ":"), strict=True):
        left.semilogy(f, values, style, color=colour, label=label, lw=1.6)
        right.semilogy(f, np.maximum(np.abs(values / reference - 1), 1e-7), style, color=colour, label=label, lw=1.4)
    left.semilogy(at, full, "o", color="black", ms=3.5, label="full model")
    for axes, name in ((left, "normal force in the right contact, N per N"), (right, "relative error of the force")):
        plain(axes)
        axes.set_xlabel("excitation frequency in Hz")
        axes.set_ylabel(name)
    fig.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=10, frameon=False)
    return drawn(fig)


# your own model ----------------------------------------------------------------------------------------------------


def own() -> None:
    """The keywords of decks; a bracket's surfaces and a mast's modes, as tutorials make them."""
    fill("your_own_model.md", "keywords", keywords())
    folder = BUILD / "own"
    for name in ("own_step", "matrices"):
        (folder / name).mkdir(parents=True, exist_ok=True)
        play(f"tutorials/{name}.md", folder / name)
    save(from_file(folder / "own_step" / "bracket" / "surfaces.png"), "bracket_surfaces")
    mast = read_basis(folder / "matrices" / "build" / "mast" / "basis.h5")
    save(picture(points_sheet, mast, mast.groups[0, 0], most=4), "mast_modes")


def reference() -> None:
    """The references of body.toml, contact.toml and case.toml, of the modal file and of the public names."""
    fill("modal_file.md", "modal_file", modal_reference())
    for name, (page, _) in FILES.items():
        fill(page, name, file_reference(name))
    fill("python.md", "public", public_reference())
    fill("the_book.md", "wall", wall())
    fill("the_book.md", "figures", figure_states())


def python() -> None:
    """The curve of Duffing's oscillator, as the first block of the page draws it."""
    import microslip as ms

    duffing = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    fig = figure(5.6, 3.4)
    axes = fig.subplots()
    plain(axes)
    ms.follow(duffing, 0.3, 2.5, harmonics=7, unit="rad/s").plot(axes, color="#0b4f9c")
    save(drawn(fig), "python")


def two_tones() -> None:
    """Duffing's oscillator under two forces, and how a slider's amplitudes converge to those of motions in time."""
    import tones_study as study

    from microslip.analysis import Drawing
    from microslip.stages.answer import drawn
    from microslip.verbs.two_tones import draw_point

    point = Drawing(partial(draw_point, study.duffing(), 0), size=(9.0, 6.4))
    save(from_file(drawn(point, BUILD / "two_tones.png")), "two_tones")
    fill("two_tones.md", "slider", table(*study.slider()))


def ring_down() -> None:
    """The sample vane whose loads are taken off at its resonance, and the map of its amplitudes."""
    BUILD.mkdir(parents=True, exist_ok=True)
    with contextlib.chdir(BUILD):
        typed(["ring-down", "sample", "--set", "ring_down.normal_force=20.0", "--set", "ring_down.down_to=0.05"])
        band = [f"--set=sweep.{key}={value}" for key, value in (("start", 330), ("stop", 410), ("points", 121))]
        typed(["map", "sample", "--set", "map.low=2.0", "--set", "map.high=200.0", *band])
    for name in ("ring_down", "map"):
        save(from_file(BUILD / "build" / "sample" / "pictures" / f"{name}.png"), name)


def worn_vane() -> None:
    """The sample vane between neighbours that it overlaps, whose contacts wear: over hours and over the patches."""
    BUILD.mkdir(parents=True, exist_ok=True)
    overlap = [f"contacts.{side}.interference=1e-4" for side in ("right", "left")]
    band = ["sweep.start=250", "sweep.stop=450", "sweep.points=51"]
    asked = ["name=worn-vane", *overlap, *band, "wear.coefficient=4e-14", "wear.hours=15000"]
    with contextlib.chdir(BUILD):
        typed(["wear", "sample", *(f"--set={one}" for one in asked)])
    for name in ("wear", "wear_depth"):
        save(from_file(BUILD / "build" / "worn-vane" / "pictures" / f"{name}.png"), f"vibration_{name}")


def mistuning() -> None:
    """The mistuned ring with friction: amplification, envelopes beside first order, the worst sample, and a table."""
    import mistuning_study as study

    for name, file in study.pictures().items():
        save(from_file(file), name, colours=2 * LINES if name.endswith("sensitivity") else LINES // 2)
    fill("mistuning.md", "amplification", table(*study.amplification()))
    fill("mistuning.md", "first_order", table(*study.first_order()))


def identification() -> None:
    """Blades that are found from modes and from gauges: accuracy, coverage, the error of the model."""
    import identification_study as study

    fig = figure(6.4, 4.6)
    places = fig.subplots(2, 1, sharex=True)
    for axes in places:
        plain(axes)
    study.picture(*places)
    save(drawn(fig), "mistuning_identification", colours=LINES)
    for name in ("modes", "model", "gauges"):
        fill("mistuning_identification.md", name, table(*getattr(study, name)()))


def rolling() -> None:
    """A wheel on a rail: creep curve and tractions; profiles that wear."""
    from microslip.stages.rolling import roll_stage

    wear = ["name=wheel-rail-worn", "wear={coefficient=2e-13, updates=20, passages=1e6}", "model.exact=0"]
    case = ROOT / "pipeline" / "cases" / "wheel-rail.toml"
    worn = [file for file in roll_stage(case, BUILD, wear).files if file.stem == "wearing"]
    for file in [*roll_stage(case, BUILD).files, *worn]:
        if file.suffix == ".png":
            save(from_file(file), f"rolling_{file.stem}", colours=LINES)


def unround_wheels() -> None:
    """A wheel with three lobes: wear over its circumference, and growth by order over distance and speed."""
    from PIL import Image

    from microslip.stages.rolling import roll_stage

    made = roll_stage(ROOT / "pipeline" / "cases" / "unround-wheel.toml", BUILD).files
    parts = [from_file(file) for file in made if file.suffix == ".png"]
    whole = Image.new("RGB", (max(p.width for p in parts), sum(p.height for p in parts)), "white")
    for k, part in enumerate(parts):
        whole.paste(part, ((whole.width - part.width) // 2, sum(p.height for p in parts[:k])))
    save(whole, "unround_wheels", colours=LINES)


def tyre() -> None:
    """A rubber wheel whose slip jumps."""
    from microslip.stages.rolling import roll_stage

    for file in roll_stage(ROOT / "pipeline" / "cases" / "slip-jump.toml", BUILD).files:
        if file.suffix == ".png":
            save(from_file(file), "tyre", colours=LINES)


def half_space() -> None:
    """Exact half-spaces that roll: convergence, Kalker's coefficients, wear, timings, one patch with its heat."""
    import half_space_study as study

    fig = figure(8.0, 3.3)
    study.picture(*fig.subplots(1, 2, width_ratios=(1.5, 1)))
    save(drawn(fig), "half_space", colours=8)
    for name in ("convergence", "coefficients", "worn_profiles", "timings"):
        fill("half_space.md", name, table(*getattr(study, name)()))


# the stability page ------------------------------------------------------------------------------------------------


def stability() -> None:
    """The disc brake: roots at 120 rpm, and how many grow at which speeds."""
    from PIL import Image

    import microslip as ms
    from microslip.pictures.roots import over_picture, plane_picture

    brake = ROOT / "geometry" / "disc-brake"
    drawn_to = BUILD / "stability.png"
    roots = ms.stability(brake, certify=False)
    save(Image.open(plots.save(partial(plane_picture, roots), drawn_to)), "stability_roots")
    over = ms.stability(brake, over="speed", values=np.linspace(2 * np.pi, 10 * np.pi, 100))
    save(Image.open(plots.save(partial(over_picture, over), drawn_to)), "stability_speeds")
    rpm, counts = over.values * 30 / np.pi, over.unstable
    runs = np.split(np.arange(len(counts)), np.flatnonzero(np.diff(counts)) + 1)
    rows = [[f"{rpm[r[0]]:.1f} to {rpm[r[-1]]:.1f} rpm", str(counts[r[0]])] for r in runs]
    fill("stability.md", "stability_speeds", table(["speed", "roots that grow"], rows))


def squeal() -> None:
    """The map and the limit cycles of `make squeal`, from the folder in which it works."""
    from microslip.stages.running import run_case_file

    page, _ = run_case_file(ROOT / "pipeline" / "cases" / "squeal.toml")
    for name in ("map", "cycles", "relief"):
        drawn = from_file(page.parent / "pictures" / f"roots_{name}.png")
        save(drawn, f"squeal_{name}".removesuffix("s"), colours=LINES // 2)
    moving, frames = from_file(page.parent / "pictures" / "root_1_disc.gif"), []
    for i in range(3):  # the other half of the period is its mirror
        moving.seek(i * moving.n_frames // 6)
        frames.append(moving.convert("RGB"))
    save(lettering.side_by_side(frames), "squeal_wave", colours=40)
    small_gif(moving, "squeal")


def small_gif(moving: Any, name: str, width: int = 420, colours: int = LINES // 2) -> None:
    """Every other frame of an animation, small enough for the front page."""
    from PIL import Image

    frames = []
    for i in range(0, moving.n_frames, 2):
        moving.seek(i)
        frame = moving.convert("RGB")
        frames.append(frame.resize((width, frame.height * width // frame.width), Image.Resampling.LANCZOS))
    palette = frames[0].quantize(colours)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    how = {"append_images": flat[1:], "duration": 120, "loop": 0, "optimize": True}
    flat[0].save(PICTURES / f"{name}.gif", save_all=True, **how)


# the cyclic page ---------------------------------------------------------------------------------------------------

SHROUD_ORDERS = (2, 4, 6, 8, 12, 24)


def cyclic() -> None:
    """Conventions of cyclic symmetry drawn, and the shrouded blade's diagrams with free and with sticking shrouds."""
    from microslip.pictures import ring_views
    from microslip.ring import expansion as ring
    from microslip.ring import resonances

    save(drawn(conventions_sketch()), "cyclic_conventions")
    speeds = ("rotation.speeds_rpm=[0, 1500, 3000, 4500]", "modes.count=8", 'cyclic.nodal_diameters="all"')
    basis = replace(made("shroud-cyclic", "shroud", *COARSE_SHROUD, *LIGHT, *speeds), name="shroud")
    closed = replace(sticking(basis), name="shroud, contacts stuck")
    with_studio(basis, lambda studio: save(ring_picture(ring_views, studio), "cyclic_ring"))
    save(picture(diagrams.nodal_diameter_plot, closed), "cyclic_nodal_diameters")
    save(picture(diagrams.safe_plot, at_one_speed(closed, 2), SHROUD_ORDERS), "cyclic_safe")
    save(picture(diagrams.cyclic_campbell_plot, basis, SHROUD_ORDERS), "cyclic_campbell")
    found = [r for r in resonances.resonances(basis, SHROUD_ORDERS) if r.family <= 3]
    fill("cyclic.md", "resonances", table(list(resonances.HEAD), [list(row) for row in resonances.rows(found)]))
    orders = (1, 6, 11, 12, 13, 18, 23, 24, 25, 30, 36)
    fill("cyclic.md", "aliases", table(["e", "k", "wave"], [[e, *ring.aliased(e, 24)] for e in orders]))
    rows = []
    for k in (0, 1, 2, 4, 6, 8, 12):
        free, held = basis.groups[0, k].frequency, closed.groups[0, k].frequency
        rows.append([k, ring.multiplicity(k, 24), *(f"{f:.2f}" for f in free[:3]), *(f"{f:.1f}" for f in held[:3])])
    head = ["k", "modes of the ring each", *(f"free {j}" for j in (1, 2, 3)), *(f"stuck {j}" for j in (1, 2, 3))]
    fill("cyclic.md", "frequencies", table(head, rows))


def sticking(basis: ModalBasis) -> ModalBasis:
    """The ring whose contacts stick without any relative motion: its frequencies and shapes in the same groups."""
    from microslip.ring.neighbours import stuck

    groups = {}
    for key, g in basis.groups.items():
        omega, x = stuck(basis, g, "right")
        count = g.kind.count("normal")
        groups[key] = replace(
            g, omega=omega[:count], kind=("normal",) * count, phi=g.phi @ x[:, :count], gyroscopic=None,
            damping_ratio=np.zeros(count),
        )  # fmt: skip
    return replace(basis, groups=groups)


def at_one_speed(basis: ModalBasis, speed: int) -> ModalBasis:
    return replace(basis, groups={(0, k): g for (s, k), g in basis.groups.items() if s == speed})


def ring_picture(ring_views: Any, studio: views.Studio) -> Any:
    """Four nodal diameters of the ring in its first mode."""
    ring = ring_views.open_ring(studio.basis, studio.stage)
    groups = [studio.basis.groups[0, k] for k in (0, 1, 2, 12)]
    return ring_views.ring_sheet(ring, groups, 1, ring_views.ring_camera(ring, 80_000), across=4)


def conventions_sketch() -> Any:
    """Twelve sectors seen against the axis: their numbers, left and right, and both waves of two nodal diameters."""
    fig = figure(10.2, 4.9)
    left, right = fig.subplots(1, 2)
    N, k = 12, 2
    angle = 2 * np.pi / N * np.arange(N)
    for axes in (left, right):
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_xlim(-1.75, 1.75)
        axes.set_ylim(-1.6, 1.75)
    for j, a in enumerate(angle):
        for edge in (a - np.pi / N, a + np.pi / N):
            left.plot(*(np.outer([0.45, 1.0], [np.sin(edge), np.cos(edge)]).T), color="#c2c7d0", linewidth=1)
        left.text(0.78 * np.sin(a), 0.78 * np.cos(a), str(j), ha="center", va="center", fontsize=11)
    turn = np.linspace(0, 2 * np.pi, 200)
    for radius in (0.45, 1.0):
        left.plot(radius * np.sin(turn), radius * np.cos(turn), color="#5b6270", linewidth=1)
    for side, text, colour in ((-1, "left", "#d98410"), (1, "right", "#26863c")):
        edge = side * np.pi / N
        left.plot(*(np.outer([0.45, 1.0], [np.sin(edge), np.cos(edge)]).T), color=colour, linewidth=3)
        left.text(0.62 * side, 1.13, f"{text} face\nof sector 0", color=colour, ha="center", fontsize=9)
    left.plot(0, 0, "o", mfc="none", mec="#111111", markersize=11)
    left.plot(0, 0, "x", color="#111111", markersize=6)
    left.text(0, -0.22, "axis points\naway", ha="center", va="center", fontsize=8)
    arc(left, 1.28, 2.35, 3.9, "#111111")
    left.text(0, -1.5, "positive rotation Omega, and numbers of the sectors", ha="center", fontsize=9)
    wave = 1 + 0.22 * np.cos(k * turn)
    right.plot(np.sin(turn), np.cos(turn), color="#c2c7d0", linewidth=1)
    right.plot(wave * np.sin(turn), wave * np.cos(turn), color="#0b4f9c", linewidth=1.2)
    u = 1 + 0.22 * np.cos(k * angle)
    right.plot(u * np.sin(angle), u * np.cos(angle), "o", color="#0b4f9c", markersize=6)
    arc(right, 1.42, 2.2, 0.95, "#0b4f9c")
    right.text(1.72, 1.12, "backward:\nexp(+i omega t)", color="#0b4f9c", ha="center", fontsize=9)
    arc(right, 1.42, -2.2, -0.95, "#c8382c")
    right.text(-1.72, 1.12, "forward:\nexp(-i omega t)", color="#c8382c", ha="center", fontsize=9)
    arc(right, 0.5, 2.35, 3.9, "#111111")
    right.text(0, -0.02, "rotation", ha="center", fontsize=9)
    right.text(0, -1.5, "two nodal diameters: u(j) = R^j phi exp(i j k 2 pi / N)", ha="center", fontsize=9)
    return fig


def arc(axes: Any, radius: float, start: float, stop: float, colour: str) -> None:
    """An arrow along a circle; angles from the top, clockwise."""
    a = np.linspace(start, stop, 60)
    x, y = radius * np.sin(a), radius * np.cos(a)
    axes.plot(x[:-2], y[:-2], color=colour, linewidth=1.6)
    tip = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "mutation_scale": 16}
    axes.annotate("", (x[-1], y[-1]), (x[-3], y[-3]), arrowprops=tip)


# contact stiffness -------------------------------------------------------------------------------------------------


def stiffness_sources() -> None:
    """When a contact is a spring, when it yields, how it slips; the layer of 5.3 by its sides."""
    import stiffness_study as study

    fill("contact_stiffness.md", "layers", table(*study.layers()))
    save(drawn(study.picture(figure(10.5, 3.4), plain)), "contact_stiffness")


def rough() -> None:
    """Rough contacts: the laws, what a profile gives, the book's wear example."""
    import rough_study as study

    fill("contact.md", "profile", table(*study.numbers()))
    fill("contact.md", "worn", table(*study.worn()))
    for name, draw in (("rough_laws", study.laws), ("rough_profile", study.profile), ("wear", study.wear)):
        save(drawn(draw(figure(10.5, 3.4), plain)), name)


def laws() -> None:
    """Contact laws: friction characteristics, the point contact element, loops, microslip."""
    import law_study as study

    save(drawn(study.friction(figure(10.5, 3.4), plain)), "friction")
    for name, draw in (("element", study.element), ("stick_slip", study.stick_slip), ("loops", study.loops)):
        save(drawn(draw()), f"contact_{name}")
    save(drawn(study.microslip(figure(10.5, 6.6))), "microslip")
    save(drawn(study.elements(figure(9.6, 3.8), plain)), "microslip_elements")


def time_domain() -> None:
    """The impact oscillator of section 4.2 from the pendulum's modal file, rigid and with its bending."""
    import time_domain_study as study

    basis = made("pendulum", "pendulum")
    found = study.motions(basis)
    fill("time_domain.md", "pendulum", table(*study.rows(found)))
    fill("time_domain.md", "balanced", table(*study.against_balance()))
    path = BUILD / "phase_portraits.png"
    save(from_file(study.drawn(found, path)), "phase_portraits", colours=LINES)
    slides = study.sliding(made("pendulum-sliding", "pendulum/sliding.toml"))
    fill("time_domain.md", "sliding", table(*study.slips(slides)))
    save(from_file(study.drawn_sliding(slides, BUILD / "sliding_portraits.png")), "sliding_portraits", colours=LINES)


def continuation() -> None:
    """Curves of solutions with kinks, folds and a narrow gap."""
    import curve_study as study

    save(drawn(study.curves(figure(10.5, 3.4), plain)), "continuation")


def followed() -> None:
    """Stability at folds, a nonlinear mode and the resonances on it, an optimum."""
    import following_study as study

    save(drawn(study.three(figure(13.0, 3.9), plain)), "followed")


def accuracy() -> None:
    """Estimates and checks of a response against what is true."""
    import accuracy_study as study

    found = study.measured()
    head = ["harmonics", "samples", "true error, median", "largest", "not counted, median", "largest", "covered"]
    fill("accuracy.md", "accuracy", table(head, study.rows(found)))
    save(drawn(study.figure(figure(10.2, 4.2), found)), "accuracy")


def microslip() -> None:
    """Microslip: errors of the strips over their number."""
    import microslip_study as study

    fill("contact.md", "strips", table(*study.errors()))


def book_mode() -> None:
    """The book's contact: its figures, and what its tables know of their errors."""
    import book_study as study

    fill("book_mode.md", "errors", table(*study.errors()))
    save(drawn(study.figures(figure(10.2, 7.4))), "book_mode")
    basis = modes_stage(open_job(ROOT / "geometry" / "blade", ["mesh.size=12"], BUILD))[0]
    points = ["sweep.points=61", "contacts.0.points=[24,3]", "contacts.1.points=[24,3]"]
    changes = [*points, "sweep.normal_forces=[10,20,30,60,780]", "harmonics=3", "cycles=10"]
    case = ROOT / "pipeline" / "cases" / "blade-rough.toml"
    found, pairs, _ = compare_book(case, basis, changes, report=print, root=BUILD)
    fill("book_mode.md", "compared", table(*study.compared(pairs)))
    save(from_file(found.parent / "pictures" / "book.png"), "book_compared")


def book_figures() -> None:
    """Figures of the book that a formula draws, and those of rolling contact."""
    import figure_study as study
    import heat_study
    import rolling_study as rolled

    for name, drawing in (("book_figures", study), ("book_rolling", rolled)):
        save(drawn(drawing.picture(figure(10.5, 5.2), plain)), name, colours=LINES)
    save(drawn(heat_study.picture(figure(11.5, 10.5))), "book_heat", colours=LINES)
    force, moment = 100 * study.discretisation()
    print(f"Fig. 5.2-2: 8 elements miss {force:.1f} % of the force, {moment:.1f} % of the moment at most")


def patches() -> None:
    """Contacts between bodies: a pin in its hole by Hertz and on springs."""
    import patch_study as study

    fill("harmonic_balance.md", "foundations", table(*study.foundations()))
    save(drawn(study.pressures(figure(10.2, 3.6))), "contact_line")


def results() -> None:
    """Stresses of the test blade on a rotor, and its contacts in partial slip."""
    import result_study as study


    made("blade-at-speed", "blade", *study.AT_SPEED)
    with contextlib.chdir(BUILD):  # where `made` has left the body
        typed(["respond", f"{study.CASES}/blade.toml", *study.DRIVEN])
    pictures = BUILD / "build" / "blade-at-3000-rpm" / "pictures"
    for file, name in (("stress_at_resonance", "result_stress"), ("haigh", "result_haigh")):
        save(from_file(pictures / f"{file}.png"), name)
    basis = made("blade-rough", "blade", "mesh.size=12", *LIGHT)
    maps = study.maps(basis, 60.0, 112.0)
    save(picture(operating.contact_map_plot, maps, "blade: 60 N, 112 Hz"), "result_contacts")


def ring() -> None:
    """The 24 blades of section 5.5: modes, engine orders, normal force, stress at the foot."""
    import ring_study as study

    stress = ("output.gauss=false", "mesh.size=12")
    basis = made("blade-stress", "blade", *stress)
    r = study.ring(basis, study.COARSE, samples=32)
    fig = figure(7.2, 3.6)
    many = study.ring(made("blade-60", "blade", *LIGHT, "mesh.size=12", "modes.count=60"), study.COARSE, samples=32)
    rows = study.modes_picture(many, fig.subplots())
    save(drawn(fig), "ring_modes")
    fill("ring_case.md", "modes", table(["modes", "below 200 Hz", "above"], rows))
    for name, draw in (("ring_forces", study.forces_picture), ("ring_orders", study.orders_picture)):
        fig = figure(10.0, 4.2)
        axes = fig.subplots(1, 2)
        rows = draw(r, *axes) or rows
        save(drawn(fig), name)
    head = ["engine order", "beta = 0: Hz", "beta = 30: Hz", "beta = 0: MPa", "beta = 30: MPa"]
    fill("ring_case.md", "orders", table(head, rows))
    at = ["excitations.magnet.point=[2.5,30,237.5]", "monitors.accelerometer.point=[2.5,30,237.5]"]
    group = basis.groups[0, 0]
    damped = replace(group, damping_ratio=2 * group.damping_ratio, C_r=2 * group.C_r)
    other = {
        "excited and read at 237.5 mm": made("blade-stress-237", "blade", *stress, *at),
        "D = 0.2 %": replace(basis, groups={(0, 0): damped}),
    }
    head = ["change", "optimum, N", "resonance, Hz", "amplitude, µm", "stress, MPa"]
    fill("ring_case.md", "optimum", table(head, study.assumptions(r, other)))
    rows = []
    for size in (24, 12, 8):
        own = replace(r, basis=made(f"blade-stress-{size}", "blade", "output.gauss=false", f"mesh.size={size}"))
        h = study.highest(own.problem(100.0), own.basis, study.WIDE)
        rows.append([f"{size}", f"{h.frequency:.2f}", f"{1e6 * h.amplitude:.1f}", f"{1e-6 * h.stress:.2f}"])
    head = ["element size, mm", "resonance at 100 N, Hz", "amplitude, µm", "stress, MPa"]
    fill("ring_case.md", "mesh", table(head, rows))


def rig() -> None:
    """The rig of three bodies: responses and resonances of both arrangements over the normal force."""
    import coupled_study as study

    def body(name: str) -> ModalBasis:
        folder, _, rest = name.removeprefix("rig-").partition("-")
        path = {"blade": "blade", "neighbour": "rig-neighbour"}[folder]
        coarse = ["mesh.size=16"] if folder == "blade" else []
        return made(f"{name}-coarse", path + (f"/{rest}.toml" if rest else ""), *LIGHT, *coarse)

    forces = (780.0, 300.0, 100.0, 50.0, 20.0, 10.0)
    first = study.over_forces("rig", forces, body, "harmonics=3", "periodicity=1e-6")
    second = study.over_forces("rig-second", forces, body, "harmonics=3", "periodicity=1e-6")
    fig = figure(10.0, 4.0)
    study.rig_picture(first, second, *fig.subplots(1, 2))
    save(drawn(fig), "rig_forces")
    rows = [
        [f"{a.normal:g}", *(x for r in (a, b) for x in (f"{r.frequency:.2f}", f"{1e6 * r.amplitude:.3g}"))]
        for a, b in zip(first, second, strict=True)
    ]
    rows = [[x.replace("nan", "none") for x in row] for row in rows]
    head = ["F_N, N", "first: resonance, Hz", "amplitude, µm", "second: resonance, Hz", "amplitude, µm"]
    fill("rig_case.md", "forces", table(head, rows))


def multicoupling() -> None:
    """Shrouds and dampers between the blades of a ring: responses and stress over the damper's normal force."""
    import coupled_study as study
    import ring_study

    stress = ("output.gauss=false", "mesh.size=16")
    dampers = study.dampers(made("blade-damped-16", "blade/damped.toml", *stress))
    r = ring_study.ring(made("blade-stress-16", "blade", *stress), ring_study.COARSE, samples=32)
    alone = r.problem(800.0)
    without = ring_study.highest(alone, r.basis, np.linspace(100.0, 130.0, 13))
    fig = figure(10.0, 4.0)
    axes = fig.subplots(1, 2)
    study.dampers_picture(dampers, ring_study.amplitudes(alone, study.SHOWN), *axes)
    save(drawn(fig), "multicoupling")
    head = [
        "damper's normal force, N", "resonance, Hz", "amplitude, µm", "stress at the foot, MPa",
        "damper open, largest share", "with nine harmonics",
    ]  # fmt: skip
    fill("multicoupling.md", "forces", table(head, study.rows(without, dampers)))


def bolted_pipes() -> None:
    """The half pipes of section 5.7: bending and torsion over the tangential stiffness, fit and prediction."""
    import bolted_study as study

    basis = made("half-pipe-bolted", "half-pipe", *LIGHT, "mesh.size=16")
    fill("bolted_pipes.md", "stiffness", table(
        ["tangential stiffness, N/m", "bending, Hz", "torsion, Hz"],
        study.table_of(basis, (1e5, 1e6, 1e7, 1e8, 1e9, 1e11)),
    ))  # fmt: skip
    rich = made("half-pipe-rubin", "half-pipe", *LIGHT, "mesh.size=16", 'reduction="rubin"', "modes.count=30")
    rows = []
    for k in (5e7, 2e8, 1e9):
        truth = study.joined(rich, k)
        (bending, _), (torsion, _) = truth.of("bending"), truth.of("torsion")
        own, found = study.fitted(basis, bending)
        away = percent(found.of("torsion")[0], torsion)
        rows.append([f"{k:.3g}", f"{bending:.1f}", f"{own:.3g}", f"{torsion:.1f}", away])
    head = ["stiffness, N/m", "bending, Hz", "fitted, N/m", "torsion, Hz", "predicted"]
    fill("bolted_pipes.md", "fit", table(head, rows))
    fig = figure(10.0, 4.2)
    study.picture(basis, *fig.subplots(1, 2))
    save(drawn(fig), "bolted_pipes")


def belt() -> None:
    import bifurcation_study as study

    study.followed(BUILD / "belt", lambda _: None)
    fig = figure(10.0, 3.0)
    fig.set_dpi(90)
    places = fig.subplots(1, 3)
    study.panels(BUILD / "belt", places)
    for axes in places:
        plain(axes)
    save(drawn(fig), "bifurcation")
    fill("bifurcation.md", "belt", table(*study.compared(BUILD / "belt")))


STUDIES = {
    f.__name__: f
    for f in (
        reference,
        python,
        two_tones,
        ring_down,
        worn_vane,
        mistuning,
        identification,
        stability,
        squeal,
        rolling,
        unround_wheels,
        tyre,
        half_space,
        geometry,
        meeting,
        damping_element,
        damping_wire,
        spin_pit,
        closure,
        closed,
        contact_stiffness,
        bolts,
        contact,
        convergence,
        sensitivity,
        arrangement2,
        first,
        speed,
        speeds,
        rotation,
        compliance,
        counted_once,
        reduction,
        own,
        cyclic,
        stiffness_sources,
        rough,
        laws,
        microslip,
        time_domain,
        belt,
        continuation,
        followed,
        accuracy,
        book_mode,
        book_figures,
        patches,
        results,
        ring,
        rig,
        multicoupling,
        bolted_pipes,
    )  # fmt: skip
}


def main(names: Sequence[str]) -> None:
    if unknown := set(names) - set(STUDIES):
        raise SystemExit(f"unknown: {', '.join(sorted(unknown))}; the studies are {', '.join(STUDIES)}")
    PICTURES.mkdir(exist_ok=True)
    BUILD.mkdir(parents=True, exist_ok=True)
    for name in names or STUDIES:
        began = time.perf_counter()
        STUDIES[name]()
        print(f"{time.perf_counter() - began:6.1f} s  {name}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
