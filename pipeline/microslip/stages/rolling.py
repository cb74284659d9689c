"""Rolling contact of a case: wheel and rail, a vehicle on unround wheels, wear by given kinematics,
a tyre whose slip jumps; tables, pictures and a page of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis import Answer, Files
from ..basis import read_basis
from ..errors import UserError, in_its_file, of_file
from ..files import store
from ..files.tables import csv_files, rows_csv
from ..pictures import can_draw
from ..pictures.moving import assembled_picture
from ..pictures.rolling import curve_picture, traction_picture, wearing_picture, write_tractions_vtu
from ..pictures.tyre import tyre_picture
from ..pictures.vehicle import circumference_picture, growth_picture, recorded_picture
from ..reduced.coordinates import basis_in_modes
from ..report.page import Piece, number, say, table
from ..report.response import number_tables
from ..results import Journal
from ..rolling import tyre
from ..rolling.behind import ROWS, Behind, behind
from ..rolling.contact_table import contact_table, write_contact_table
from ..rolling.settings import RollingCase, SectionKeys, load_rolling
from ..rolling.study import RollingAnswer, rows_of_patches, study
from ..rolling.table import creep_table, write_creep_table
from ..rolling.wearing import wearing
from ..system.pairing import Place
from ..vehicle import kinematics
from ..vehicle import study as vehicle
from ..vehicle.settings import KinematicsCase, VehicleCase, load_kinematics, load_vehicle
from .answer import Written, made
from .job import Job, open_job
from .modal import modes_stage
from .places import TYRE, WHEEL_AND_RAIL, find_body, keys_of
from .stage import Report, Stage, folder_of_case


class RollingKind(NamedTuple):
    """What rolls.

    Attributes:
        keys: by which a case is known, all of them. product: its name. title: of the page. load:
            reads the case. bodies: of a case, key of the half-space that a body stands for -> its
            name; "" where there is none. files: that a case names. solve: is called with the case,
            its path, its modal files, a journal and `report`.
    """

    keys: frozenset[str]
    product: str
    title: str
    load: Callable[..., tuple[Any, dict[str, Any]]]
    bodies: Callable[[Any], Mapping[str, str]]
    files: Callable[[Any], Sequence[str]]
    solve: Callable[..., Answer]


def roll_stage(
    path: Path,
    root: Path = Path("build"),
    assignments: Sequence[str] = (),
    force: bool = False,
    report: Report = lambda _: None,
    pictures: bool = True,
    folder: Path | None = None,
) -> Written:
    """What a case of rolling contact asks for, in a folder, if not given that of its name below `root`; whole if it
    did not end early. Modal files of its bodies are made where they are not up to date.

    Raises:
        UserError: mistakes of the case, its bodies or its profiles.
    """
    kind = next((kind for kind in KINDS if kind.keys <= keys_of(path)), KINDS[-1])
    case, raw = kind.load(path, list(assignments))
    product = (folder or folder_of_case(path, case.name, root)) / f"{kind.product}.json"
    stage = Stage(product, ("stages.rolling",), force, report, case=path)
    bodies = _bodies(kind.bodies(case), case, path, report)
    named: list[Path | str] = [*kind.files(case), *bodies]
    files = [path.parent / name for name in named]  # of what is missing its reader tells
    inputs = {"case": raw, "files": [store.hash_file(file) for file in files if file.is_file()]}
    solve = partial(kind.solve, case, path, bodies, report=report)
    with of_file(path):
        return made(stage, inputs, f"{case.name}: {kind.title}", pictures, solve, case.name)


def _bodies(named: Mapping[str, str], case: Any, path: Path, report: Report) -> list[Path]:
    """Modal files of the bodies."""
    jobs = {key: open_job(find_body(path, name, Path("."))) for key, name in named.items()}
    for key, job in jobs.items():
        if key:
            _of_one_material(path, key, job, getattr(case, key))
    return [modes_stage(job, report=report)[0].resolve() for job in jobs.values()]


@in_its_file
def _of_one_material(case_path: Path, key: str, job: Job, section: SectionKeys) -> None:
    """A body and the half-space that stands for its contact, of which one is taken out and the
    other put in."""
    own = [getattr(job.settings.material, name, None) for name in ("young", "poisson")]
    asked = [section.young, section.poisson]
    if None not in own and own != asked:
        raise UserError(
            f"{key}.young, {key}.poisson: {asked} in the case and {own} in {job.path}; with "
            "[elastic] "
            "they must be the same, correct one"
        )


def _wheel_on_rail(
    case: RollingCase, path: Path, bodies: list[Path], _: Journal, report: Report
) -> Answer:
    report("patches and creep curve")
    found, worn = study(case, path), None
    files, said, elastic = _tables(found), found.sentences(), _behind(found, bodies)
    if case.contacts is not None:
        how = case.contacts.model_dump()
        contacts = contact_table(found.track, case.vertical_force, **how, report=report)
    if case.wear is not None and case.wear.updates:
        worn = wearing(case, found.track, case.characteristic(path), case.surface(path), report)
        profiles = {
            "wheel_worn.csv": worn.wheel,
            "rail_worn.csv": worn.rail,
        }  # in mm, as a case takes them
        worn_tables = {name: profile.columns(worn.smoothing) for name, profile in profiles.items()}
        files |= csv_files({"wearing.csv": worn.columns(), **worn_tables}, 10)
    if elastic is not None:
        files |= csv_files({"stiffness.csv": {"direction": ROWS, **elastic.columns()}}, 8)
        said.append(elastic.sentence())
    if case.table is not None:
        report("table of creep forces")
        how = case.model.model_dump(include={"distribution", "coefficients"})
        forces = creep_table(found.track.elastic.poisson, **case.table.model_dump(), **how)
        files["creep_table.h5"] = lambda file: write_creep_table(file, forces)
        said.append(forces.sentence())
    if case.contacts is not None:
        files["contact_table.h5"] = lambda file: write_contact_table(file, contacts)
        said.append(contacts.sentence())
    if found.forces is not None:
        title = f"{case.name}: creep curve"
        files["pictures/creep.png"] = partial(curve_picture, found, title=title)
        files["pictures/tractions.png"] = partial(traction_picture, found, title=case.name)
    if worn is not None:
        said += [worn.sentence(), *worn.warnings()]
    if worn is not None and found.forces is not None:
        files["pictures/wearing.png"] = partial(wearing_picture, worn, title=case.name)

    def moving(folder: Path) -> list[Path]:
        made = [_yielding(case, bodies, folder)] if elastic is not None and can_draw() is None else []
        if found.forces is not None and found.tractions is not None and find_spec("meshio"):
            write_tractions_vtu(found.tractions, file := folder / "tractions.vtu")
            made.append(file)
        return made

    notes = [_patches(found), say(OF_PATCHES, tone="note")]
    return Answer(said, tables=notes, files=files, moving=moving)


def _yielding(case: RollingCase, bodies: list[Path], folder: Path) -> Path:
    """The wheel on its rail, and how their modes yield to equal and opposite forces on the patch."""
    assert case.elastic is not None
    bases = {n: basis_in_modes(read_basis(file)) for n, file in zip(("wheel", "rail"), bodies, strict=True)}
    groups = {name: basis.groups[0, 0] for name, basis in bases.items()}
    faces = {name: group.interfaces[case.elastic.face] for name, group in groups.items()}
    places = {name: Place(np.eye(3), faces["rail"].origin - face.origin) for name, face in faces.items()}
    shapes = {}
    for direction, row in ROWS.items():
        number = ("u_n", "u_t1", "u_t2").index(row)
        along = faces["wheel"].rotation[number]
        forces = {"wheel": along, "rail": -along}  # N, of unit size
        shapes[direction] = {
            name: group.phi @ ((faces[name].rotation @ forces[name]) @ faces[name].rows[:3] / group.omega**2) + 0j
            for name, group in groups.items()
        }
    path = folder / "pictures" / "behind.png"
    return assembled_picture(shapes, bases, places, f"{case.name}: forces on the patch", path)


def _behind(found: RollingAnswer, bodies: list[Path]) -> Behind | None:
    elastic = found.case.elastic
    if elastic is None or not found.patches:
        return None
    files = [read_basis(file) for file in bodies]
    groups, methods = [b.groups[0, 0] for b in files], [b.reduction for b in files]
    return behind(found.patches[0], found.case.solids, groups, elastic.face, methods)


def _tables(found: RollingAnswer) -> Files:
    rows = {"patches.csv": rows_of_patches(found.patches)}
    made: Files = {}
    if found.forces is not None:
        columns = {
            "creep.csv": found.columns(),
            "exact.csv": found.beside(),
            "wear.csv": found.worn(),
        }
        made, rows["forces.csv"] = csv_files(columns, 8), found.generalised()
    return made | {name: partial(store.write_text, text=rows_csv(*of)) for name, of in rows.items()}


OF_PATCHES = (
    "Forces act on the wheel, at the middle of the patch: x forward, y to the left, z up. A "
    "positive creepage means "
    "that the wheel's surface moves forward (to the left) against the rail, and gives a negative "
    "force. Hertz' ellipse "
    "with the mean curvature over the patch; strips of point contacts (Sextro, 6.5)."
)


def _patches(found: RollingAnswer) -> Piece:
    head = ["y on the rail in mm", "angle in mrad", "a, b in mm", "normal force in N", "pressure in MPa",
            "creepages", "spin in 1/m"]  # fmt: skip
    rows = [
        [number(1e3 * p.on_rail), number(1e3 * p.angle, 3), f"{1e3 * p.a:.3g}, {1e3 * p.b:.3g}",
         number(p.normal_force, 5), number(p.pressure / 1e6), f"{p.xi:.3g}, {p.eta:.3g}", number(p.phi, 3)]
        for p in found.patches
    ]  # fmt: skip
    return table(head, rows)


def _recorded(
    case: KinematicsCase, path: Path, _: list[Path], journal: Journal, report: Report
) -> Answer:
    found = kinematics.recorded(case, path.parent, report, journal)
    tables = {"circumference.csv": found.circumference(), "wear.csv": found.jumped()}
    drawn = {"pictures/circumference.png": partial(recorded_picture, found, title=case.name)}
    return Answer(found.sentences(), whole=not found.ended, files=csv_files(tables, 10) | drawn)


def _unround(
    case: VehicleCase, path: Path, _: list[Path], journal: Journal, report: Report
) -> Answer:
    found = vehicle.study(case, path.parent, report, journal)
    tables = {
        "circumference.csv": found.circumference(),
        "growth.csv": found.growing(),
        "speeds.csv": found.over_speed(),
    }
    drawn = {
        "pictures/circumference.png": partial(circumference_picture, found, title=case.name),
        "pictures/growth.png": partial(growth_picture, found, title=case.name),
    }
    return Answer(
        found.sentences(),
        tables=[say(OF_ANGLES, tone="note")],
        whole=not found.ended,
        files=csv_files(tables, 10) | drawn,
    )


OF_ANGLES = (
    "Angles count from the mark of the wheel: what stands at 90 degrees rolls over the rail a "
    "quarter of a turn after "
    "the mark. Radii are those that the contact sees, means weighted by its pressure. Wear is "
    "the coefficient times the frictional work over each strip (Sextro, 6.8-6), laid over the "
    "strips of the tread."
)


def _tyre(case: tyre.TyreCase, _: Path, bodies: list[Path], __: Journal, report: Report) -> Answer:
    report("jumps of slip and load")
    wheel = read_basis(bodies[0])
    found = tyre.study(case, wheel.groups[0, 0])
    slips, forces = found.steady
    tables = {
        "loads.csv": found.loads(),
        "constants.csv": found.constants,
        "steady.csv": {"slip": slips, "force_over_normal_force": forces},
    }
    drawn = {"pictures/tyre.png": partial(tyre_picture, found, title=case.name, wheel=wheel)}
    pieces = [*number_tables({"loads.csv": tables["loads.csv"]}), say(OF_TYRES, tone="note")]
    return Answer(found.sentences(), tables=pieces, files=csv_files(tables, 8) | drawn)


OF_TYRES = (
    "A row of point contacts along the middle of the patch, each with its share of the static "
    "pressure, is passed by "
    "the material (Sextro, 6.10). Time constants are of the exponential that fits the force best; "
    "the normal force "
    "follows from the static state, large displacements and contact by Newton's method. Reached: 1 "
    "- 1/e of the change."
)


def _profiles(case: Any) -> list[str]:
    return [s.profile for s in (case.wheel, case.rail) if isinstance(s.profile, str)]


def _elastic(case: RollingCase) -> dict[str, str]:
    return {} if case.elastic is None else {"wheel": case.elastic.wheel, "rail": case.elastic.rail}


KINDS = (
    RollingKind(
        WHEEL_AND_RAIL | {"vehicle"}, "unround", "unround wheels", load_vehicle,
        lambda _: {}, _profiles, _unround,
    ),
    RollingKind(
        WHEEL_AND_RAIL | {"kinematics"}, "unround", "wear of a wheel", load_kinematics,
        lambda _: {}, lambda case: [*_profiles(case), case.kinematics.file], _recorded,
    ),
    RollingKind(
        TYRE, "tyre", "unsteady rolling", tyre.load_tyre,
        lambda case: {"": case.tyre.body}, lambda _: (), _tyre,
    ),
    RollingKind(
        WHEEL_AND_RAIL, "rolling", "rolling contact", load_rolling,
        _elastic, lambda case: case.files, _wheel_on_rail,
    ),
)  # fmt: skip
"""The first one whose keys a case has is meant."""
