"""What keeps these pages true: tables made by program, examples that are run, references of settings and files.

Marks in a page:

    <!-- table NAME --> ... <!-- end -->     filled in by make_pictures.py
    <!-- file PATH -->                       the fenced block that follows is written to PATH
    <!-- run -->                            the lines of the block that follows are typed into a shell
"""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import microslip
from microslip.case.driving import GroundOfCase
from microslip.case.settings import ContactSettings, case_model
from microslip.contact.settings import ContactFile
from microslip.data import (
    Compliance,
    ContactState,
    GyroscopicModes,
    Interface,
    Invariants,
    Mesh,
    ModalBasis,
    ModalGroup,
    Residual,
    Rows,
    RunUp,
    SpeedRange,
    StressSet,
)
from microslip.files.declared import declared
from microslip.settings.body import BodySettings, _is_length

HERE = Path(__file__).parent
BLOCK = re.compile(r"<!-- (file|run)(?: ([^\n]*?))? -->\n+```\w*\n(.*?)```", re.S)


def fill(page: str, name: str, text: str) -> None:
    """Put `text` between the marks ``<!-- table NAME -->`` and ``<!-- end -->`` of a page."""
    path = HERE / page
    old = path.read_text(encoding="utf-8")
    place = re.compile(rf"(<!-- table {name} -->\n).*?(<!-- end -->)", re.S)
    new, count = place.subn(lambda m: f"{m[1]}{text.strip()}\n{m[2]}", old)
    if count != 1:
        raise SystemExit(f"{page}: has {count} places for the table '{name}'")
    if new != old:
        path.write_text(new, encoding="utf-8")


def filled(page: str, name: str) -> str:
    """What stands between the marks now."""
    found = re.search(rf"<!-- table {name} -->\n(.*?)<!-- end -->", (HERE / page).read_text(encoding="utf-8"), re.S)
    assert found, f"{page} has no table {name}"
    return found[1].strip()


def table(head: list[str], rows: list[list[Any]]) -> str:
    """A Markdown table; columns that begin with a bare number, or one with its unit, are aligned right."""
    right = ["---:" if re.fullmatch(r"[-+]?[\d.e-]+( \S{1,3})?", str(v)) else "---" for v in rows[0]]
    lines = [head, right, *[[str(v) for v in row] for row in rows]]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


# examples ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Step:
    """A file to write (`path`) or lines to type."""

    path: str
    text: str


def steps(page: str) -> Iterator[Step]:
    """The examples of a page in order."""
    for kind, more, text in BLOCK.findall((HERE / page).read_text(encoding="utf-8")):
        yield Step(more if kind == "file" else "", text)


def play(
    page: str, folder: Path, more: Mapping[str, str] | None = None, type_in: Callable[[str, Path], str] | None = None
) -> str:
    """Do what a page says in an empty folder, with this Python's `microslip`; returns what the commands printed.

    more: words to add to lines that begin so. type_in: runs a line in the folder, `typed` if not given.

    Raises:
        RuntimeError: a command failed.
    """
    shown = []
    for step in steps(page):
        if step.path:
            (folder / step.path).parent.mkdir(parents=True, exist_ok=True)
            (folder / step.path).write_text(step.text, encoding="utf-8")
        else:
            lines = [line for line in step.text.splitlines() if line and not line.startswith("#")]
            shown += [(type_in or typed)(" ".join([line, *added(line, more or {})]), folder) for line in lines]
    return "\n".join(shown)


def added(line: str, more: Mapping[str, str]) -> list[str]:
    return [words for begin, words in more.items() if line.startswith(begin)]


def typed(line: str, folder: Path) -> str:
    """Run one line in a shell."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{line}\n{done.stdout}{done.stderr}")
    return f"$ {line}\n{done.stdout}"


# body.toml ---------------------------------------------------------------------------------------------------------

MEANING: dict[str, tuple[str, str]] = {
    # key: (unit, meaning); "*" stands for the unit of the file's lengths
    "name": ("", "names the products: `meshes/NAME.msh`, `build/NAME/`, of no other body of the name"),
    "description": ("", "one line for the report"),
    "length_unit": ("", "unit of every length in this file and of the mesh or CAD file"),
    "reduction": ("", "method of reduction, see reduction.md"),
    "free": ("", "the body is meant to float; rigid motions are kept, [at speed](rotation.md#free-bodies) too"),
    "values": ("", "table: name of a parameter = its value, 1 if not given; the speed stands in rotation.speeds_rpm"),
    "parameters.role": ("", "matrix it is added to"),
    "parameters.matrix": ("", "FILE or FILE#NAME, times factor (value / reference)^power"),
    "parameters.name": ("", "of the parameter; speed is that of rotation.speeds_rpm, in rad/s"),
    "parameters.power": ("", "-1 for what falls with the speed, 0 for a constant matrix"),
    "parameters.factor": ("", "of the matrix"),
    "parameters.reference": ("", "value of the parameter at which the matrix stands as it is"),
    "stability.growth": ("1/s", "growth rates of the window of roots, from, to"),
    "stability.frequency": ("Hz", "frequencies of the window, from, to"),
    "stability.over": ("", "parameter of the diagram"),
    "stability.range": ("", "its first and last value, speed in rad/s; no diagram if not given"),
    "stability.points": ("", "number of values between them"),
    "stability.tolerance": ("", "largest relative error of a root at the values held out from the basis"),
    "stability.accuracy": ("", "relative, of the matrices' entries: decides which growth rates are neutral"),
    "stability.neutral": ("1/s", "growth rates below it are neutral whatever the accuracy"),
    "stability.certify": ("", "count the roots by the argument principle"),
    "note": ("", "a remark that `modes` and the report repeat; `import` says here what it left out of a mesh file"),
    "geometry.build": (
        "",
        "a Python file that draws the body with gmsh; one outside its folder, by a path or a link, is refused",
    ),
    "geometry.cad": ("", "a STEP, BREP or IGES file"),
    "geometry.mesh": ("", "a mesh file (.inp, .msh, .med, .unv, .vtu, ...) with named sets"),
    "geometry.instances": ("", "those instances of the deck that are this body; all if not given"),
    "geometry.matrices.stiffness": ("", "K: FILE or FILE#NAME; .mtx, .mat, .h5, .npz, .op4, DMIG cards, .sti"),
    "geometry.matrices.mass": ("", "M, likewise"),
    "geometry.matrices.damping": ("", "C, likewise; instead of [damping]"),
    "geometry.matrices.gyroscopic": ("", "G, likewise, skew-symmetric, at the speed of rotation.speeds_rpm"),
    "geometry.matrices.circulatory": (
        "",
        "what the stiffness holds beside its symmetric part (friction, follower forces), any square matrix; goes to "
        "N_r, see [stability](stability.md)",
    ),
    "geometry.matrices.dofs": (
        "",
        "node and direction (1 to 6) of every row: lines `node.direction` or two columns; not needed where the "
        "matrices name their rows, or where every node has three or six rows in the order of `nodes`",
    ),
    "geometry.matrices.nodes": (
        "",
        "number, x, y, z: .csv, .mat, .h5, GRID cards, or a mesh with its sets; without it "
        "every row is a generalised coordinate and the supports are in the matrices",
    ),
    "geometry.matrices.units": ("", "of the matrices; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"),
    "geometry.matrices.grounded": ("", "the supports are in the matrices already"),
    "geometry.matrices.superelement": ("", "rows without a node are the generalised coordinates of a superelement"),
    "geometry.matrices.sets": ("", "table: name of a set = list of node numbers"),
    "geometry.parameters": ("", "table handed to the build file"),
    "geometry.faces.name": ("", "name of the face; several rules of one name add up"),
    "geometry.faces.label": ("", "the surface's label in the CAD file, or a part of it"),
    "geometry.faces.colour": ("0-255", "the surface's colour, red, green, blue"),
    "geometry.faces.box": ("*", "x, y, z of the low and of the high corner; what lies wholly inside"),
    "geometry.faces.cut": ("", "CAD: whether the box cuts: its part of the surface becomes a face of its own"),
    "geometry.faces.touching": (
        "",
        "another file of the same kind in the same coordinates, or the body's own deck (what of it is not this body); "
        "where the two surfaces meet; with box: inside it",
    ),
    "geometry.faces.surfaces": ("", "numbers from the table of `microslip info FILE`"),
    "mesh.size": ("*", "size of the elements; chosen from the body where it is not given"),
    "mesh.integration": (
        "",
        'of the stiffness; `"reduced"` takes 8 points in bricks of 20 nodes, which do not lock near a Poisson\'s ratio '
        "of 0.5",
    ),
    "mesh.order": ("", "order of the elements; 1 is far too stiff in bending"),
    "mesh.local": ("*", "table: name of a face = size there"),
    "material.name": ("", "for the report"),
    "material.density": ("kg/m3", ""),
    "material.young": ("Pa", "Young's modulus; orthotropic: E1, E2, E3"),
    "material.poisson": ("", "Poisson's ratio; orthotropic: nu12, nu23, nu13"),
    "material.shear": ("Pa", "orthotropic only: G12, G23, G13"),
    "material.axes": ("", "orthotropic only: the material's three axes in body axes"),
    "material.expansion": ("1/K", "thermal expansion, one or along the three material axes"),
    "material.temperature": ("K", "rising temperatures of `modulus_factor`"),
    "material.modulus_factor": ("", "factor on the moduli at those temperatures; linear between, constant outside"),
    "material.from": ("", "the mesh file's own material, or materials"),
    "material.units": ("", "of the mesh file; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"),
    "material.unusual": ("", "silences the warnings about implausible units"),
    "temperature.from": ("", "both temperatures from the mesh file"),
    "temperature.scale": ("", "of the mesh file's temperatures: °C or K"),
    "temperature.reference": ("K", "free of thermal stress"),
    "temperature.uniform": ("K", "one temperature everywhere"),
    "temperature.file": ("*, K", "CSV lines x, y, z, T; linear between, nearest outside"),
    "supports.face": ("", "face, or set of points, that is held"),
    "supports.directions": ("", "body directions in which it is held"),
    "supports.rotations": ("", "hold rotations of its nodes too, all or some (matrices, reference nodes)"),
    "rotation.axis": ("", "direction of the rotor axis"),
    "rotation.point": ("*", "a point of the axis"),
    "cyclic.sectors": ("", "N, how many of this body make the ring"),
    "cyclic.left": ("", "face towards the previous sector"),
    "cyclic.right": ("", "face towards the next sector: the left one turned by 2 pi / N about the rotation axis"),
    "cyclic.nodal_diameters": ("", "which to analyse, or all from 0 to N/2"),
    "output.stress_nodal_diameters": ("", "nodal diameters whose stress modes are kept (a file grows by them)"),
    "output.shape_nodal_diameters": ("", "nodal diameters whose shapes, of body and patches, are kept"),
    "rotation.speeds_rpm": ("rpm", "speeds to analyse, rising"),
    "rotation.prestress": ("", "how the stiffness at speed is made, see [modes](modes.md#equilibrium-at-speed)"),
    "rotation.spin_softening": ("", "whether -Omega^2 M P is in K"),
    "rotation.gyroscopic": ("", "whether the modes with gyroscopic coupling are computed at speed, see rotation.md"),
    "rotation.engine_orders": ("", "lines of the Campbell diagram"),
    "rotation.range_rpm": ("rpm", "lowest and highest speed of one basis for all speeds between, see speeds.md"),
    "rotation.range_points": ("", "speeds of the Campbell diagram over the range"),
    "rotation.range_tolerance": ("", "relative frequency error allowed at held-out speeds of the range"),
    "rotation.range_stress": ("", "strain and stress modes at every speed of the range (large files)"),
    "loads.kind": ("", "a static load that acts at every speed"),
    "loads.face": ("", "of a pressure or a force"),
    "loads.point": ("*", "of a force"),
    "loads.value": ("Pa", "of a pressure, positive into the body"),
    "loads.vector": ("m/s2 or N", "of gravity or a force"),
    "closures.name": ("", "the contact's name in the modal file and the report"),
    "closures.face": ("", "face whose points are held apart from the other side (the finer meshed one)"),
    "closures.against": ("", "the face it meets, or `ground`"),
    "closures.sector_shift": ("", "where that face is: next blade 1, previous -1, this body 0"),
    "closures.interference": ("*", "by how much the drawn faces overlap when assembled; negative: a further gap"),
    "closures.point": ("*", "of the ground; the middle of the face if not given"),
    "closures.normal": ("", "of the ground, towards the body; opposite to the face if not given"),
    "closures.modes": (
        "",
        "`open`: the modes leave the contact to the friction law, its static force stays; "
        "`closed`: they keep its stiffness along the normal, free to slide",
    ),
    "closures.slide": ("*", "how far the faces may slide on each other; 1.5 elements if not given"),
    "closures.penalty": ("Pa/m", "only the number of iterations depends on it; chosen from the modulus if not given"),
    "bolts.name": ("", ""),
    "bolts.face": ("", "the ring under the head"),
    "bolts.against": ("", "the ring under the nut, or `ground`"),
    "bolts.preload": ("N", "force of the bolt; keeps its direction"),
    "interfaces.name": ("", ""),
    "interfaces.face": ("", "the contact patch"),
    "interfaces.role": ("", "see [conventions](conventions.md#frames)"),
    "interfaces.partner": ("", "name of the interface it faces"),
    "interfaces.sector_shift": ("", "where the partner is: next blade 1, previous -1, else 0"),
    "interfaces.t2": (
        "",
        "direction whose projection on the patch becomes t2; if not given z, or y where the patch lies across z",
    ),
    "interfaces.normal": ("", "outward normal of a list of nodes that does not tell it itself (matrices only)"),
    "interfaces.coordinates": ("", "rigid: six; characteristic: six and the softest shapes of the patch"),
    "interfaces.count": ("", "how many characteristic shapes"),
    "excitations.name": ("", ""),
    "excitations.point": ("*", "where a unit force acts"),
    "excitations.node": ("", "or the number of a node in the mesh file"),
    "excitations.face": ("", "or the face over which it is spread"),
    "excitations.direction": ("", "of the force; its length does not matter"),
    "excitations.pressure": ("", "a unit pressure (1 Pa) on the face instead"),
    "excitations.centrifugal": ("", "the centrifugal force on the whole body per (rad/s)^2 about the [rotation] axis"),
    "monitors.name": ("", ""),
    "monitors.point": ("*", "where displacements are read"),
    "monitors.node": ("", "or the number of a node in the mesh file"),
    "monitors.directions": ("", "body directions"),
    "monitors.points": (
        "*",
        "or places that turn: read is the angle, rad, about `axis` of the rigid motion that fits them best; two read "
        "the difference of their displacements over their distance",
    ),
    "monitors.axis": ("", "of that angle, right-handed; neither its length nor its place matters"),
    "gauges.name": ("", ""),
    "gauges.point": ("*", "where the strain is read"),
    "gauges.direction": ("", "of the strain gauge"),
    "modes.count": ("", "how many modes"),
    "modes.max_frequency": ("Hz", "only modes below it; `count` is then the upper limit"),
    "modes.certify": ("", "prove by an inertia count that none is missing"),
    "modes.solver": ("", "sparse direct solver, see [platforms](platforms.md)"),
    "damping.ratio": ("", "one damping ratio D for all modes"),
    "damping.table": ("", "a ratio per mode; the last one serves all further modes"),
    "damping.alpha": ("1/s", "Rayleigh damping alpha M + beta K"),
    "damping.beta": ("s", "Rayleigh damping"),
    "output.shapes": ("", "mode shapes at all nodes"),
    "output.patch_shapes": ("", "mode shapes at the points of contact and load faces"),
    "output.gauss": ("", "strain and stress modes at integration points (the largest part of the file)"),
    "output.stiffening": ("", "whether the modal file holds how large rigid motion stiffens the body, see rotation.md"),
    "output.nodal_stress": ("", "strain and stress modes smoothed to the nodes"),
}


MEANING_CONTACT: dict[str, tuple[str, str]] = {
    "name": ("", "names the folder of the products, `build/NAME/`"),
    "description": ("", ""),
    "length_unit": ("", "unit of every length in this file; areas are its square"),
    "normal_stiffness": ("N/m", "c_N0, short for [stiffness] of kind given"),
    "tangential_stiffness": ("N/m", "c_R0, likewise"),
    "stiffness.kind": ("", "its [source](contact_stiffness.md)"),
    "stiffness.normal": ("N/m", "c_N0"),
    "stiffness.tangential": ("N/m", "c_R0; or two, along t1 and t2"),
    "stiffness.area": ("*²", "A_0, nominal area; needed for yield, heat, microslip and wear"),
    "stiffness.includes": ("", "which compliance the numbers count"),
    "stiffness.young": ("Pa", "E, of the first body"),
    "stiffness.poisson": ("", "nu"),
    "stiffness.shear": ("Pa", "G, if it is not E/2(1 + nu)"),
    "stiffness.thickness": ("*", "l_0, depth of the layer"),
    "stiffness.boundary": ("", "what holds the sides of the layer (3.1)"),
    "stiffness.density": ("kg/m3", "for the limit of application"),
    "stiffness.radii": ("*", "principal radii of the first body: inf is flat, negative is hollow"),
    "stiffness.young_2": ("Pa", "of the second body; the first one's if not given"),
    "stiffness.poisson_2": ("", "likewise"),
    "stiffness.radii_2": ("*", "of the second body"),
    "stiffness.angle": ("rad", "of the second body's first axis from the first one's"),
    "stiffness.file": ("", "columns of a curve; a modal file; sought beside this one"),
    "stiffness.columns": ("", "of displacement and force, counted from 1 or by name"),
    "stiffness.displacement_unit": ("", "in the curve's file"),
    "stiffness.force_unit": ("", "in the curve's file"),
    "stiffness.gap": ("", "the displacement of the file opens the contact"),
    "stiffness.noise": ("N", "by which the force may fall between neighbours; evened then"),
    "stiffness.interface": ("", "name of the contact in the modal file"),
    "stiffness.facing": ("", "the other contact of the same body that is closed at the same time"),
    "stiffness.axis": ("", "of the ellipse, 0 or 1, that t1 lies along"),
    "roughness.kind": ("", "cumulative height distribution; without [roughness] the faces are smooth"),
    "roughness.R_Z": ("*", "highest peak to deepest valley of the heights; of a table its deepest depth if not given"),
    "roughness.R_Z_other": ("*", "of the other face, with the polynomial's heights; the two are combined (3.3-10)"),
    "roughness.rate": ("", "R_Z/sigma_S"),
    "roughness.mean": ("", "over R_Z, below the highest peak"),
    "roughness.deviation": ("", "over R_Z"),
    "roughness.depth": ("*", "below the highest peak, rising from 0"),
    "roughness.share": ("", "of the area that lies higher, from 0 to 1"),
    "roughness.file": ("", "columns of depth (in length_unit) and share; a profile: way and height"),
    "roughness.columns": ("", "counted from 1 or by name"),
    "roughness.unit": ("", "of the heights in the profile"),
    "roughness.way_unit": ("", "of the way; that of the heights if not given"),
    "roughness.level": ("", "order of the polynomial that is taken off the profile, or none"),
    "friction.kind": ("", "friction characteristic"),
    "friction.mu": ("", "coefficient"),
    "friction.static": ("", "coefficient at rest"),
    "friction.sliding": ("", "coefficient of sliding"),
    "friction.mu_0": ("", "coefficient at zero speed, cold"),
    "friction.p_v": ("s/m", "of (3.6-15)"),
    "friction.mu_inf": ("", "coefficient at high speed"),
    "friction.rate": ("s/m", "lambda_e"),
    "friction.file": ("", "columns of speed in m/s (above 0, rising) and coefficient"),
    "friction.columns": ("", "counted from 1 or by name"),
    "friction.temperature": ("K", "at which it slides"),
    "friction.reference": ("K", "at which it was measured"),
    "friction.c_1": ("", "of Williams, Landel and Ferry"),
    "friction.c_2": ("K", "likewise"),
    "friction.viscosity": ("Pa s", "of the fluid"),
    "friction.film": ("", "smallest film over R_Z; the fluid part has no value without"),
    "friction.deviation": ("", "relative standard deviation in time"),
    "friction.memory": ("s", "correlation exp(-t/memory)"),
    "friction.seed": ("", "of the random numbers"),
    "law.kind": ("", "what sticks, slips and opens"),
    "law.slides_along": ("", "the tangent with the slider of Jenkins elements"),
    "law.damping": ("s", "beta: force per rate of the springs (3.7-18)"),
    "law.length": ("*", "l_0: the hyperbolic law of a short layer (3.4)"),
    "law.preload": ("N", "a constant normal force in place of a normal law"),
    "law.mass": ("kg", "m_D, reduced mass of the full area"),
    "law.slope": ("s/m", "k_S of the smoothed friction (3.7-43)"),
    "law.printed": ("", "the book's stretch of the springs, which may give energy"),
    "law.count": ("", "of strips or sliders"),
    "law.weakest": ("", "strength of the weakest slider over that of the strongest"),
    "law.exponent": ("", "chi of Segalman's distribution"),
    "law.restitution": ("", "e of an impact between masses"),
    "law.ratio": ("", "beta: stiffness of its last slider over that of all others"),
    "motion.frequency": ("Hz", ""),
    "motion.normal": ("*", "u_n, positive closes: mean, cos, sin, cos 2, sin 2, ..."),
    "motion.t1": ("*", "u_t1, likewise"),
    "motion.t2": ("*", "u_t2, likewise"),
    "motion.normal_force": ("N", "static; instead of the mean of `normal`"),
    "motion.drift": ("m/s", "constant speed along t1 besides"),
    "motion.cycles": ("", "how many; the last one is drawn"),
    "motion.samples": ("", "a cycle"),
    "motion.amplitudes": ("*", "of the hysteresis loops along t1; about the slip limit if not given"),
    "microslip.mu": ("", "friction coefficient, cold; that of [friction] if not given"),
    "microslip.speed": ("m/s", "of loading, for the heat"),
    "microslip.yield_shear": ("Pa", "tau_S0, shear strength, cold"),
    "microslip.approaches": ("*", "one curve each"),
    "microslip.normal_forces": ("N", "one curve each; instead of approaches"),
    "microslip.displacement": ("*", "up to which it is drawn"),
    "wear.normal_force": ("N", "constant"),
    "wear.speed": ("m/s", "of sliding"),
    "wear.time": ("s", ""),
    "wear.mu": ("", "friction coefficient; that of [friction] at the speed if not given"),
    "wear.coefficient": ("m3/J", "I_W: worn volume over frictional work"),
    "wear.archard": ("", "K: worn volume = K force way/hardness"),
    "wear.hardness": ("Pa", "of the softer body"),
    "wear.energy_density": ("J/m3", "Fleischer's: frictional work over worn volume"),
    "temperature.resistance": ("K m2/W", "k_T: rise of temperature over heat flow"),
    "temperature.limit": ("K", "dT_E: rise at which friction and shear strength would be gone"),
    "limits.yield_shear": ("Pa", "tau_S, yield stress in shear: half of that in tension"),
    "limits.tolerance": ("", "error of the static stiffness that is allowed (3.2-31)"),
    "limits.boundary": ("", "what holds the sides, for the yield check where the stiffness is not a layer's"),
}


MEANING_CASE: dict[str, tuple[str, str]] = {
    "name": ("", "names the folder of the products, `build/NAME/`"),
    "description": ("", "one line for the report"),
    "body": ("", "the only body, short for one `[[bodies]]`"),
    "speed": ("", "of the only body: which speed of its modal file, from 0"),
    "speed_rpm": ("rpm", "or a speed of the file or of its range"),
    "modes": ("", "how many of those that the modal file stores"),
    "excitation": ("", "short for one `[[excitations]]`"),
    "amplitude": ("N, Pa", "of that excitation"),
    "monitor": ("", "short for one `[[monitors]]`"),
    "direction": ("", "of that monitor"),
    "mode": ("", "laws marched in time, or the [book's contact](book_mode.md)"),
    "damping": ("", "[how the ratios are meant](excitation.md#damping): of each body's own modes (the book's), as loss "
                "factors of the bodies, or of the modes with sticking contacts; if not given, `modal` for one body, "
                "`structural` for several"),
    "damping_ratio": ("", "of the bodies that give none themselves, or of the stuck modes: one, or one a mode, the "
                      "last one for all that follow"),
    "strips": ("", "book's mode: into how many strips a patch's roughness makes microslip; 0: none"),
    "harmonics": ("", "H, besides the mean; `auto`: [as many as the error asks for]"
                  "(harmonic_balance.md#what-is-followed-instead-of-swept)"),
    "harmonics_error": ("", "of `auto`: estimated error of the resonances that is allowed, a share of the amplitude; "
                        "0.01 if not given"),
    "samples": ("", "of a cycle; at least four a harmonic; sixteen a harmonic and 48 at least if not given"),
    "cycles": ("", "marched at most until the sliders are periodic"),
    "periodicity": ("", "at most 0.01: share of the largest force within which they count as periodic; 0: all cycles "
                    "are marched"),
    "memory_limit": ("GiB", "that the points of contact may take, by [an estimate](harmonic_balance.md#what-it-costs) "
                     "before they begin; that of the machine if not given"),
    "bodies.name": ("", "in this case"),
    "bodies.body": ("", "name of the body whose modal file it is, looked for as said above; the name if not given"),
    "bodies.file": ("", "a modal file beside the case instead"),
    "bodies.speed": ("", "which speed of the modal file, from 0"),
    "bodies.speed_rpm": ("rpm", "or a speed of the file or of its range"),
    "bodies.damping_ratio": ("", "instead of the file's: one, or one a mode, the last one for all that follow"),
    "bodies.aerodynamics": ("", "a table (.csv) of [what the flow adds](excitation.md#damping) to every wave"),
    "bodies.modes": ("", "how many of those that the modal file stores"),
    "bodies.mass": ("kg", "of the same shape and stiffness at rest, made of another density"),
    "bodies.pressed_at_rpm": ("rpm", "whose centrifugal load presses a loose body into its contacts, as normal forces"),
    "bodies.turn": ("degrees", "about the body's rotation axis, from where its file has it"),
    "bodies.weak_springs": ("Hz", "that hold a body which nothing else does: frequency of its rigid motions"),
    "bodies.shift": ("m", "from where its file has it, after the turn"),
    "ring.blades": ("", "N, as many as the sectors of a cyclic body"),
    "ring.engine_order": ("", "of the swept frequency; if not given, the greatest common divisor of those that "
                          "excitations name, or 1; negative: [round with the rotor](excitation.md#engine-orders)"),
    "ring.rotation": ("", "`-`: the rotor turns from sector 1 to sector 0"),
    "ring.model": ("", "one sector that stands for all, or all of them"),
    "excitations.row": ("", "excitation of a body, `body:excitation` where there are several"),
    "excitations.amplitude": ("N, Pa", "0-peak; of a pressure field: a factor"),
    "excitations.phase": ("degrees", "by which it leads"),
    "excitations.harmonic": ("", "of the swept frequency; 0: steady"),
    "excitations.tone": ("", "2, where the harmonic is one of a second frequency, see `[two_tones]`"),
    "excitations.engine_order": ("", "instead of the harmonic"),
    "excitations.steady": ("N, Pa", "steady gas load, with stimulus instead of amplitude"),
    "excitations.stimulus": ("", "its share that vibrates"),
    "excitations.speed_rpm": ("rpm", "of a centrifugal excitation, instead of amplitude and harmonic"),
    "excitations.field": ("", "file of a [complex pressure field](excitation.md#pressure-fields), instead of a row"),
    "excitations.face": ("", "where the field acts: an interface, or a face that an excitation of the body names"),
    "excitations.length_unit": ("", "of the field's x, y, z"),
    "excitations.time_factor": ("", "`-`: the field stands for p exp(-i Omega t)"),
    "excitations.magnets.angles": ("degrees", "where they stand around the rotor"),
    "excitations.magnets.force": ("N", "peak of each, or one for all"),
    "excitations.magnets.width": ("degrees", "over which each is felt"),
    "excitations.magnets.pulse": ("", "cos^2, or constant over the width"),
    "excitations.magnets.place": ("degrees", "of the loaded spot of the first blade at time 0"),
    "excitations.magnets.highest": ("", "engine order"),
    "monitors.monitor": ("", "of a body, `body:monitor` where there are several; all drawn, resonances of the first"),
    "monitors.direction": ("", "in body axes"),
    "contacts.interface": ("", "of a body, `body:interface` where there are several; its frame is the contact's"),
    "contacts.against": ("", "`ground`, or the other interface"),
    "contacts.against_sector": ("", "of a ring: how many sectors further the other body stands"),
    "contacts.normal_force": ("N", "where the sweep's forces are not this contact's"),
    "contacts.interference": ("m", "or how far the faces overlap at rest; negative: a gap"),
    "contacts.file": ("", "a [contact.toml](contact_toml.md) instead of stiffnesses, friction, law and roughness"),
    "contacts.stiffness": ("", "as in a [contact.toml](contact_toml.md), lengths in m, instead of the two below"),
    "contacts.temperature": ("", "likewise: heat of sliding"),
    "contacts.normal_stiffness": ("N/m", "c_N0 of the whole patch; **required** without stiffness, file or young"),
    "contacts.tangential_stiffness": ("N/m", "c_R0, likewise"),
    "contacts.width": ("m", "b_0 along t1; the patch's own if not given"),
    "contacts.height": ("m", "h_0 along t2, likewise"),
    "contacts.friction": ("", "coefficient, or a table as in a contact.toml; **required** without file"),
    "contacts.includes": ("", "which [compliance](contact.md) the stiffnesses count"),
    "contacts.law": ("", "name or table of a law, as in a contact.toml, also of [another package](own_law.md); `rough` "
                     "with roughness, `smooth` without if not given"),
    "contacts.roughness": ("m", "R_Z, or a table as in a contact.toml"),
    "contacts.points": ("", "how many along t1 and t2"),
    "contacts.patch": ("", "six coordinates, or points that move as the shapes of the bodies say"),
    "contacts.curvature": ("m", "relative radii along t1 and t2, inf where it is flat"),
    "contacts.young": ("Pa", "E of both bodies, for a curved patch, instead of the stiffnesses"),
    "contacts.poisson": ("", "nu of both bodies"),
    "contacts.fit": ("", "in what the springs of a curved patch agree with Hertz; `exact`: his own law, in pieces of a "
                     "line"),
    "contacts.fitted_at": ("N", "at which load; if not given the force that presses it: its own, or each of the sweep"),
    "contacts.isotropic": ("", "geometric mean of both tangential stiffnesses of a curved patch, as the book's mode "
                           "needs it"),
    "contacts.ground.velocity": ("m/s", "V of the other side, of a [motion in time](time_domain.md)"),
    "contacts.ground.direction": ("degrees", "of the velocity, from t1 towards t2"),
    "contacts.ground.rpm": ("rpm", "instead of the velocity: material that turns about the axis of the body which the "
                            "contact is against ([squeal](squeal.md))"),
    "contacts.ground.inertia": ("", "of the [material that runs through](squeal.md#the-material-that-runs-through); "
                                "false leaves it out"),
    "contacts.ground.axis": ("", "along another axis, in the axes of the case"),
    "contacts.ground.point": ("m", "through this point"),
    "contacts.ground.pushes": ("", "whether the slope of a wave pushes the body along the ground; the book: false"),
    "contacts.ground.waviness.amplitude": ("m", "y_A of a sine wave along the direction (4.3-1)"),
    "contacts.ground.waviness.length": ("m", "lambda"),
    "contacts.ground.waviness.phase": ("degrees", "where the contact begins"),
    "contacts.ground.spectrum.height": ("m", "root of the mean square of waves with a power spectrum"),
    "contacts.ground.spectrum.longest": ("m", "wave length"),
    "contacts.ground.spectrum.shortest": ("m", "wave length"),
    "contacts.ground.spectrum.exponent": ("", "with which the power falls over the wave number"),
    "contacts.ground.spectrum.waves": ("", "how many"),
    "contacts.ground.spectrum.seed": ("", "of their phases and lengths"),
    "springs.row": ("", "excitation of a body, `body:excitation` where there are several: its point and direction"),
    "springs.stiffness": ("N/m", "of the spring"),
    "springs.damping": ("N s/m", "of a damper beside it, against the ground"),
    "springs.motion": ("m", "0-peak, of its far end: moves as cos of the driving frequency"),
    "sweep.start": ("Hz", "first frequency"),
    "sweep.stop": ("Hz", "last one"),
    "sweep.points": ("", "equally spaced"),
    "sweep.patience": ("s", "CPU time for each place where the sweep jumps or has no solution, of motions in "
                            "time (seven tenths of it), the curve about it and its stability; what compiles is not "
                            "counted; 0: none of these"),
    "sweep.normal_forces": ("N", "to compare, in every contact that nothing else presses; `static`: of the body's "
                            "closures"),
    "material_limits.fatigue_strength": ("Pa", "amplitude that is endured about a zero mean"),
    "material_limits.tensile_strength": ("Pa", "ultimate"),
    "material_limits.yield_strength": ("Pa", "if given, the largest stress is held against it"),
    "material_limits.name": ("", "of the material"),
    "orders.engine_orders": ("", "`all`: 1 to N/2"),
    "orders.points": ("", "of the sweep that looks for the peaks; the sweep's if not given"),
    "speeds.start_rpm": ("rpm", "first speed"),
    "speeds.stop_rpm": ("rpm", "last one, above or below"),
    "speeds.points": ("", "equally spaced"),
    "speeds.normal_force": ("N", "`static`, one, or pairs [rpm, N], straight lines in the square of the speed; the "
                            "sweep's one if not given"),
    "ranges.damping_ratio": ("", "of all modes of all bodies, or of the stuck modes with damping = `stuck`"),
    "ranges.load": ("", "factors on the loads that are not steady"),
    "ranges.friction": ("", "coefficients of all contacts"),
    "ranges.normal_force": ("N", "of the contacts that the sweep presses"),
    "curve.band": ("Hz", "first and last frequency; the sweep's start and stop if not given"),
    "curve.load": ("", "first and last factor on the loads that are not steady"),
    "curve.normal_force": ("N", "first and last, of the contacts that the sweep presses; its smallest and largest if "
                           "not given"),
    "curve.frequency": ("Hz", "at which load or normal force vary; the highest resonance in the sweep's band if not "
                        "given, at the first normal force where that varies"),
    "curve.points": ("", "of a curve at most"),
    "orbit.frequency": ("Hz", "of the first harmonic of the excitations: one or several, one motion each"),
    "orbit.Omega": ("rad/s", "or so"),
    "orbit.run_up.start": ("Hz", "the frequency goes linearly from here; instead of `frequency`"),
    "orbit.run_up.stop": ("Hz", "to here, up or down"),
    "orbit.run_up.time": ("s", "within this time"),
    "orbit.run_up.engine_order": ("", "the rotation speed is the frequency over it; centrifugal loads follow its "
                                      "square"),
    "orbit.run_up.euler": ("", "bodies that turn with it, which feel its change as a load"),
    "orbit.settle": ("", "periods that are left to themselves"),
    "orbit.keep": ("", "periods that are kept"),
    "orbit.samples": ("", "of each that is kept"),
    "orbit.steps": ("", "of each; if not given, 150 in a period of the fastest motion with closed contacts, and 512 at "
                    "least"),
    "orbit.start": ("", "at rest under the steady loads, or as preloaded; or on the vibration of harmonic balance"),
    "orbit.release.displacement": ("m", "where the bodies are let go, instead of `start`: coordinates of all of them, "
                                   "those of their modes, zero if not given"),
    "orbit.release.velocity": ("m/s", "of these coordinates"),
    "orbit.release.mode": ("", "or a mode of the bodies without their contacts, by its number from 1"),
    "orbit.release.amplitude": ("m", "of the first monitor in that mode"),
    "orbit.normal_force": ("N", "of the contacts that the sweep presses"),
    "map.low": ("N", "the first normal force; the smallest above 0 of the sweep if not given"),
    "map.high": ("N", "the last; the largest of the sweep if not given"),
    "map.forces": ("", "how many, in equal ratios; more are added beside the lowest resonance"),
    "ring_down.frequency": ("Hz", "at which the case is driven until its loads are taken off; the highest resonance if "
                            "not given"),
    "ring_down.amplitude": ("m", "of the first read-out: the motion begins in the nonlinear mode instead"),
    "ring_down.mode": ("", "with sticking contacts, 1 the lowest, that is compared"),
    "ring_down.normal_force": ("N", "instead of those of the sweep"),
    "ring_down.down_to": ("", "share of the first amplitude at which it ends"),
    "ring_down.periods": ("", "at most"),
    "ring_down.samples": ("", "of a period"),
    "two_tones.start": ("Hz", "of the first tone"),
    "two_tones.stop": ("Hz", "if several points are asked for"),
    "two_tones.points": ("", "equally spaced"),
    "two_tones.second": ("Hz", "of the second tone, held; a guess where it is `free`"),
    "two_tones.ratio": ("", "or of the second to the first frequency"),
    "two_tones.free": ("", "whether the second frequency is that of a vibration of its own, and not known"),
    "two_tones.harmonics": ("", "pairs (k1, k2) with abs(k1) + abs(k2) up to that are balanced"),
    "two_tones.samples": ("", "of a turn of the faster angle; 8 a harmonic and 32 at least if not given"),
    "two_tones.turns": ("", "of the faster angle, at least, in the line along which contacts that remember are "
                        "marched; as many"),
    "wear.coefficient": ("m3/J", "I_W: volume that both faces of a contact lose together, over their frictional work"),
    "wear.hours": ("h", "of vibration"),
    "wear.frequency": ("Hz", "the highest resonance in the sweep's band if not given, followed as it moves"),
    "wear.normal_force": ("N", "instead of those of the sweep"),
    "wear.tolerance": ("", "share of the largest depth by which a jump in time may differ from one of first order"),
    "wear.jumps": ("", "at most"),
    "mistuning.samples": ("", "whole rings that are solved, at most"),
    "mistuning.until": ("", "ends when half of the interval of the 95 % quantile is that share of it"),
    "mistuning.rare": ("", "further samples, chosen by a linear ring, for the 99.9 % quantile; none if 0"),
    "mistuning.seed": ("", "of all random numbers; a sample depends on it and its number alone"),
    "mistuning.stuck": ("", "whether contacts stick, which is linear"),
    "mistuning.normal_force": ("N", "of the contacts that the sweep presses; its smallest if not given"),
    "mistuning.scatter.of": ("", "what differs from sector to sector"),
    "mistuning.scatter.deviation": ("", "standard deviation, a share of the nominal value; of `added_mass` kg, of "
                                    "`gap` m"),
    "mistuning.scatter.distribution": ("", "the median of a lognormal one is nominal"),
    "mistuning.scatter.values": ("", "or deviations that are known, sector by sector; a shorter pattern is repeated"),
    "mistuning.scatter.file": (
        "",
        "or a table with the column `deviation`, or `frequency_Hz`, whose mean is nominal; in the order of its rows, "
        "or of its column `blade` or `sector`",
    ),
    "mistuning.scatter.others": ("", "or sectors, from 0, that have another modal file, and the file (`{ 3 = "
                                 "\"repaired.h5\" }`), of `modal_file`"),
    "mistuning.scatter.arrangement": ("", "of the known values: as given, in another order in every sample, or each "
                                      "drawn from them"),
    "mistuning.scatter.body": ("", "whose; may be left out where there is one"),
    "mistuning.scatter.contact": ("", "its interface; may be left out where there is one"),
    "mistuning.scatter.at": ("", "monitor at which `added_mass` sits"),
    "mistuning.scatter.together": ("", "correlation between the modes of a body; 0: each alone"),
    "mistuning.scatter.neighbours": ("", "correlation between a sector and the next one"),
    "stability.growth": ("1/s", "from, to, of the roots that are wanted ([squeal](squeal.md))"),
    "stability.frequency": ("Hz", "from, to"),
    "stability.accuracy": ("", "relative, of the entries of the matrices"),
    "stability.neutral": ("1/s", "growth rates below it are neither growth nor decay"),
    "stability.full": ("", "states of the map at which the unreduced matrices are counted as well"),
    "stability.over.parameter": ("", "what the axis of the map says; two of these tables make one"),
    "stability.over.unit": ("", "of the parameter, on the axis"),
    "stability.over.keys": ("", "keys of this case, dotted, that follow the parameter, each with its factor"),
    "stability.over.start": ("", "of the parameter"),
    "stability.over.stop": ("", "above it"),
    "stability.over.points": ("", "evenly spaced"),
    "stability.cycle.parameter": ("", "over which the limit cycles born at Hopf points are followed"),
    "stability.cycle.unit": ("", "of the parameter"),
    "stability.cycle.keys": ("", "as above"),
    "stability.cycle.start": ("", "of the parameter"),
    "stability.cycle.stop": ("", "above it"),
    "stability.cycle.points": ("", "of a branch at most"),
    "stability.cycle.harmonics": ("", "of the balance along a branch"),
    "stability.cycle.accuracy": ("", "share of the amplitude to which three orbits of a branch get harmonics, that are "
                                 "compared with a motion in time and judged by their Floquet multipliers"),
    "stability.cycle.across.parameter": ("", "a second one, at whose values they are followed as well"),
    "stability.cycle.across.unit": ("", "of it"),
    "stability.cycle.across.keys": ("", "as above"),
    "stability.cycle.across.start": ("", "of it"),
    "stability.cycle.across.stop": ("", "above it"),
    "stability.cycle.across.points": ("", "values of it, evenly spaced"),
    "stability.cycle.across.harmonics": ("", "of the balance along these branches"),
    "bifurcation.name": ("", "of the diagram's files"),
    "bifurcation.parameter": ("", "what its axis says"),
    "bifurcation.unit": ("", "of the parameter, on the axis"),
    "bifurcation.keys": ("", "keys of this case, dotted, that follow the parameter, each with the factor that makes "
                         "its value; `system.` begins those of a system.toml"),
    "bifurcation.fixed": ("", "other keys and their values, of this diagram alone"),
    "bifurcation.start": ("", "of the parameter"),
    "bifurcation.stop": ("", "of it; may be the smaller one"),
    "bifurcation.orbits": ("", "whether the orbits born at Hopf points are followed"),
    "bifurcation.doublings": ("", "how often from an orbit on to that of twice its period"),
    "bifurcation.attractors": ("", "values of the parameter at which motions from many starts are left alone, to find "
                               "orbits that coexist"),
    "bifurcation.starts": ("", "how many"),
    "bifurcation.seed": ("", "from which they are drawn"),
    "bifurcation.deflate": ("", "values of the parameter at which orbits, stable or not, are looked for beside all "
                            "that is known"),
    "bifurcation.nodes": ("", "of an orbit, from which it is shot; doubled with its period"),
    "bifurcation.step": ("", "the longest along a branch, a share of start to stop"),
    "bifurcation.points": ("", "of a branch at most"),
    "bifurcation.frequency": ("Hz", "of the first harmonic of the excitations, where there are any"),
    "identification.ratio": ("", "c_T / c_N, kept"),
    "identification.stiffnesses": ("N/m", "c_N of further curves in the diagram"),
    "identification.modes": ("", "how many are drawn"),
    "identification.fit.nodal_diameter": ("", "of the frequency that is met"),
    "identification.fit.mode": ("", "from 1, in the order of the frequencies"),
    "identification.fit.frequency": ("Hz", "measured"),
    "identification.measured.nodal_diameter": ("", "of a frequency that is predicted"),
    "identification.measured.mode": ("", "from 1"),
    "identification.measured.frequency": ("Hz", "measured"),
}  # fmt: skip


def body_reference() -> str:
    """Tables of every key of body.toml, made from the models that read it.

    Raises:
        SystemExit: a key without a meaning here, or a meaning without a key.
    """
    return _reference(BodySettings, MEANING, "body.toml")


def public_reference() -> str:
    """Table of the public names: what they are called with and the first sentence of their docstrings."""
    rows = []
    for name in microslip.__all__:
        what = getattr(microslip, name)
        said = (inspect.getdoc(what) or "").split("\n\n")[0].replace("\n", " ")
        rows.append([f"`ms.{name}`", said])
    return table(["name", "what it is"], rows)


def contact_reference() -> str:
    """Tables of every key of contact.toml, likewise."""
    return _reference(ContactFile, MEANING_CONTACT, "contact.toml")


def case_reference() -> str:
    """Tables of every key of case.toml, likewise."""
    return _reference(case_model(), MEANING_CASE, "case.toml")


STORED: tuple[tuple[str, type], ...] = (
    ("", ModalBasis), ("/mesh", Mesh), ("S/interfaces/<name>", Interface), ("S", ModalGroup),
    ("S/excitation/<name>", Rows), ("S", Compliance), ("S", StressSet), ("S/contacts/<name>", ContactState),
    ("S/residual", Residual), ("S/run_up", RunUp), ("S/gyroscopic", GyroscopicModes), ("S/invariants", Invariants),
    ("/range/nd_<k>", SpeedRange),
)  # fmt: skip
"""Groups of the modal file and the nouns that stand in them."""


def modal_reference() -> str:
    """Table of what the nouns say of their fields, see `microslip.data.Stored`."""
    rows = [row for group, noun in STORED for row in stored_rows(group, noun)]
    return table(["path", "axes", "unit", "holds"], rows)


def stored_rows(group: str, noun: type) -> list[list[str]]:
    rows = []
    for field, (how, _) in declared(noun).items():
        at, axes = how.at or field, how.over.replace(" ", " x ")
        path = at if at[0] == "/" else group + at if at[0] == "@" else f"{group}/{at}"
        unit = f"`{how.unit}`" if how.unit.startswith("@") else how.unit
        rows.append([f"`{path}`", axes, unit, how.holds + (f"; only if {how.when}" if how.when else "")])
        if how.hertz:
            place = path.removesuffix("omega")
            rows.append([f"`{place}frequency`", axes, "Hz", "omega / (2 pi), never negative"])
    return rows


def _reference(model: Any, meanings: dict[str, tuple[str, str]], file: str) -> str:
    sections = list(_sections(model, "", ""))
    known = {f"{prefix}{key}" for prefix, _, _, model in sections for key in _plain_keys(model)}
    if wrong := sorted(known ^ set(meanings)):
        raise SystemExit(f"docs/pages.py: the meanings and {file} differ in {', '.join(wrong)}")
    return "\n\n".join(_section(*s, meanings) for s in sections)


def _sections(model: Any, prefix: str, title: str) -> Iterator[tuple[str, str, str, Any]]:
    yield prefix, title, "" if not prefix else " ".join((model.__doc__ or "").split("\n\n")[0].split()), model
    for key, field in _fields(model).items():
        for number, (inner, many) in enumerate(_told(model, field)):
            name = f"{prefix}{key}"
            head = f"[[{name}]]" if many else f"[{name}]"
            kinds = getattr(_fields(inner).get("kind"), "annotation", None)
            if len(_told(model, field)) > 1 and kinds is not None:
                head += " kind = " + " or ".join(f'"{kind}"' for kind in kinds.__args__)
            elif number:
                head += ", or instead"
            yield from _sections(inner, f"{name}.", head)


def _fields(model: Any) -> dict[str, Any]:
    """Keys as they are written -> fields, its own before those that it shares with others."""
    named = {field.alias or name: field for name, field in model.model_fields.items()}
    return dict(sorted(named.items(), key=lambda item: item[0] not in model.__annotations__))


def _inner(annotation: Any, many: bool = False) -> list[tuple[Any, bool]]:
    """The settings models inside an annotation (several are alternatives), and whether a list of them is meant."""
    if isinstance(annotation, type) and hasattr(annotation, "model_fields"):
        return [(annotation, many)]
    many = many or getattr(annotation, "__origin__", None) is tuple
    return [found for argument in getattr(annotation, "__args__", ()) for found in _inner(argument, many)]


def _told(model: Any, field: Any) -> list[tuple[Any, bool]]:
    """`_inner`, without the tables of a contact file in a contact of a case, which have a page of their own."""
    found = _inner(field.annotation)
    return [x for x in found if x[0] is GroundOfCase] if model is ContactSettings else found


def _plain_keys(model: Any) -> list[str]:
    return [k for k, f in _fields(model).items() if not _told(model, f)]


def _section(prefix: str, title: str, text: str, model: Any, meanings: dict[str, tuple[str, str]]) -> str:
    schema = model.model_json_schema()["properties"]
    rows = []
    for key in _plain_keys(model):
        field = _fields(model)[key]
        unit, meaning = meanings[f"{prefix}{key}"]
        if _is_length(field) and not unit.startswith("*"):
            raise SystemExit(f"docs/pages.py: {prefix}{key} is a length; mark its unit with *")
        unit = unit.replace("*", "length_unit")
        rows.append([f"`{key}`", _type(schema[key]), unit, _default(field), meaning])
    head = f"## {title}" if title else "## Top of the file"
    return f"{head}\n\n" + (f"{text}\n\n" if text else "") + table(["key", "value", "unit", "default", "meaning"], rows)


def _default(field: Any) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ("", (), {}):
        return ""
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)


WORDS = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}
SIGNS = {"exclusiveMinimum": ">", "gt": ">", "minimum": ">=", "exclusiveMaximum": "<", "lt": "<", "maximum": "<="}


def _type(schema: dict[str, Any]) -> str:
    """What may be written, in words, from a field's JSON schema."""
    if "oneOf" in schema or "$ref" in schema:
        return "table"
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(s) for s in schema["anyOf"] if s.get("type") != "null"))
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{_toml(v)}`" for v in schema.get("enum", [schema.get("const")]))
    kind = schema.get("type")
    if kind == "array":
        count = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        inner = re.sub(r"\b(number|integer)\b", r"\1s", _type(item))
        inner, times = (f"({inner})", f"{count} x") if item.get("type") == "array" else (inner, f"{count}")
        return f"{times if count else 'list of'} {inner}"
    if kind == "object":
        return "table"
    bounds = [f"{sign} {schema[k]:g}" for k, sign in SIGNS.items() if k in schema]
    return " ".join([WORDS.get(str(kind), "any"), ", ".join(bounds)]).strip()
