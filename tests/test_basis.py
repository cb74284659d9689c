"""The modal file: round trip, the documented readers, findings on tampered content, damage, hostile content."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import sector
import small
from pydantic import ValidationError
from refusals import refused

from microslip.basis import check_basis, read_basis, write_basis
from microslip.basis.files import open_file, single, size_in_words
from microslip.basis.integrals import modal_mass
from microslip.basis.strains import stiffness_error, stress_error
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
from microslip.errors import UserError
from microslip.files.declared import declared
from microslip.files.hdf5 import seal, seal_state
from microslip.files.hostile import HostileFile, inspect, trial
from microslip.modal.compute import modal_basis
from microslip.operating import motion_of
from microslip.operating.stress import cycle_stress
from microslip.settings.body import BodySettings
from microslip.system import system_basis

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "modal_file.md"
MASSES = ROOT / "pipeline/microslip/templates/three-masses/system.toml"


def same(a: object, b: object) -> bool:
    """Equal to the last bit, arrays of the same type."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        x, y = np.asarray(a), np.asarray(b)
        return x.shape == y.shape and x.dtype == y.dtype and x.tobytes() == y.tobytes()
    if dataclasses.is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, Mapping):
        return isinstance(b, Mapping) and set(a) == set(b) and all(same(a[k], b[k]) for k in a)
    return a == b


def failed(basis: ModalBasis) -> list[str]:
    return [c.name for c in check_basis(basis) if not c.passed]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("basis") / "basis.h5"
    write_basis(path, small.basis((0.0, 3000.0)))
    return path


@pytest.fixture
def copy(file: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(file, tmp_path / "copy.h5"))


# ---------------------------------------------------------------- round trip


def rounded(basis: ModalBasis) -> ModalBasis:
    """Stress modes in single precision, as files have them."""

    def of(g: ModalGroup) -> ModalGroup:
        sets = {k: dataclasses.replace(s, strain=double(s.strain), stress=double(s.stress))
                for k, s in g.stresses.items()}  # fmt: skip
        return dataclasses.replace(g, stresses=sets)

    def double(a: np.ndarray) -> np.ndarray:
        return single(a).astype(a.dtype)

    return dataclasses.replace(basis, groups={k: of(g) for k, g in basis.groups.items()})


@pytest.mark.parametrize("which", ["held", "spinning", "free"])
def test_round_trip_is_exact_and_writes_the_same_bytes(tmp_path: Path, which: str) -> None:
    basis = {"held": small.basis(), "spinning": small.basis((0.0, 3000.0)), "free": small.basis(free=True)}[which]
    write_basis(tmp_path / "a.h5", basis)
    again, basis = read_basis(tmp_path / "a.h5"), rounded(basis)
    for field in dataclasses.fields(basis):
        if field.name != "mesh":
            assert same(getattr(basis, field.name), getattr(again, field.name)), field.name
    for key, group in basis.groups.items():  # order is precedence
        assert list(group.interfaces) == list(again.groups[key].interfaces)
        assert list(group.excitations) == list(again.groups[key].excitations)
    assert same(basis.mesh.points, again.mesh.points)
    assert {n: {t: f.tolist() for t, f in b.items()} for n, b in basis.mesh.faces.items()} == {
        n: {t: f.tolist() for t, f in b.items()} for n, b in again.mesh.faces.items()
    }
    assert {n: s.tolist() for n, s in basis.mesh.point_sets.items()} == {
        n: s.tolist() for n, s in again.mesh.point_sets.items()
    }
    write_basis(tmp_path / "b.h5", again)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert failed(again) == []


def test_stress_modes_are_kept_in_single_precision(file: Path) -> None:
    """Half of their bytes and compressed; what is read of them differs in the seventh digit, shapes do not."""
    basis, again = small.basis((0.0, 3000.0)), read_basis(file)
    with h5py.File(file) as f:
        kept = f["speed_0/nd_0/stress/gauss/T"]
        assert kept.dtype == np.float32 and kept.compression == "gzip"
        assert kept.id.get_storage_size() < 0.95 * kept.size * 4
        assert f["speed_0/nd_0/modes/phi"].dtype == np.float64
    q = np.cos(np.arange(2 * basis.groups[0, 0].n_modes)).reshape(2, -1)
    found = [cycle_stress(motion_of(100.0, q, b.groups[0, 0])).amplitude for b in (basis, again)]
    np.testing.assert_allclose(found[1], found[0], atol=1e-6 * found[0].max())


def test_the_size_of_a_large_file_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    basis = small.basis()
    assert size_in_words(basis) == ""
    monkeypatch.setattr("microslip.basis.files.ANNOUNCED", 1e3)
    told = size_in_words(basis)
    assert "output.gauss" in told and "output.shapes" in told


def test_shapes_of_some_nodal_diameters(tmp_path: Path) -> None:
    """The others keep rows and matrices, the file passes its checks, and a nodal diameter that cannot be is refused."""

    def asked(diameter: int) -> BodySettings:
        more = {"modes": {"count": 4}, "output": {"gauss": False, "shape_nodal_diameters": [diameter]}}
        return BodySettings.model_validate({**sector.settings(6).model_dump(exclude_unset=True), **more})

    whole = modal_basis(sector.mesh(divisions=(2, 1, 1)), asked(1))
    write_basis(tmp_path / "a.h5", whole)
    again = read_basis(tmp_path / "a.h5")
    assert {k for (_, k), g in again.groups.items() if len(g.phi)} == {1}
    assert all(bool(len(i.shapes)) == (k == 1) for (_, k), g in again.groups.items() for i in g.interfaces.values())
    assert all(same(g.M_r, whole.groups[k].M_r) for k, g in again.groups.items())
    assert failed(again) == []
    with pytest.raises(ValidationError, match="shape_nodal_diameters"):
        asked(9)


def test_without_shapes_and_stresses(tmp_path: Path) -> None:
    basis = small.basis()
    m = basis.groups[0, 0].n_modes
    faces = {n: dataclasses.replace(i, shapes=np.zeros((0, 3, m))) for n, i in basis.groups[0, 0].interfaces.items()}
    group = dataclasses.replace(basis.groups[0, 0], phi=np.zeros((0, 3, m)), stresses={}, interfaces=faces)
    write_basis(tmp_path / "a.h5", dataclasses.replace(basis, groups={(0, 0): group}))
    again = read_basis(tmp_path / "a.h5")
    assert same(again.groups[0, 0], group)
    assert failed(again) == []


@pytest.mark.parametrize("name", ["a/b", "a%2Fb", ".", "..", "", "Fläche 1", "%", "x" * 300])
def test_any_name_of_a_set_survives(tmp_path: Path, name: str) -> None:
    basis = small.basis()
    faces, sets = {name: basis.mesh.faces["tip"]}, {name + "s": np.array([3, 5])}
    mesh = dataclasses.replace(basis.mesh, faces=faces, point_sets=sets)
    group = basis.groups[0, 0]
    first = {name: group.interfaces["right"]}  # the load patch of an excitation bears the name of its face
    group = dataclasses.replace(group, interfaces={**first, "left": group.interfaces["left"]})
    write_basis(tmp_path / "a.h5", dataclasses.replace(basis, mesh=mesh, groups={(0, 0): group}))
    again = read_basis(tmp_path / "a.h5")
    assert list(again.mesh.faces) == [name]
    assert {n: s.tolist() for n, s in again.mesh.point_sets.items()} == {name + "s": [3, 5]}
    assert list(again.groups[0, 0].interfaces) == [name, "left"]
    assert same(again.groups[0, 0].interfaces, group.interfaces)


def test_node_numbers_with_gaps(tmp_path: Path) -> None:
    basis = small.basis()
    ids = np.random.default_rng(1).permutation(10 * basis.mesh.n_points)[: basis.mesh.n_points] + 1
    mesh = dataclasses.replace(basis.mesh, node_id=ids)
    write_basis(tmp_path / "a.h5", dataclasses.replace(basis, mesh=mesh))
    again = read_basis(tmp_path / "a.h5").mesh
    assert same(again.node_id, ids)
    assert again.point_sets["tip_points"].tolist() == mesh.point_sets["tip_points"].tolist()
    with h5py.File(tmp_path / "a.h5") as f:
        assert f["mesh/groups/clamp/nodes"][:].tolist() == ids[mesh.face_points("clamp")].tolist()


@pytest.mark.parametrize("runs", ["a", pytest.param("ab", marks=pytest.mark.slow)])
def test_same_inputs_on_one_thread_give_the_same_bytes(tmp_path: Path, runs: str) -> None:
    script = (
        "import sys, small; from microslip.basis import write_basis;"
        "write_basis(sys.argv[1], small.basis((0.0, 3000.0)))"
    )
    threads = {k: "1" for k in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    paths = os.pathsep.join([str(ROOT / "tests"), str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", "")])
    hashes = set()
    for run in runs:
        out = tmp_path / f"{run}.h5"
        environment = {**os.environ, **threads, "PYTHONPATH": paths, "PYTHONHASHSEED": run.encode().hex()}
        subprocess.run([sys.executable, "-c", script, str(out)], check=True, env=environment, timeout=120)
        hashes.add(hashlib.sha256(out.read_bytes()).hexdigest())
    if len(runs) == 1:
        write_basis(tmp_path / "here.h5", small.basis((0.0, 3000.0)))
        hashes.add(hashlib.sha256((tmp_path / "here.h5").read_bytes()).hexdigest())
    assert len(hashes) == 1


# ---------------------------------------------------------------- layout and documentation


def test_every_axis_has_a_scale_or_none(file: Path) -> None:
    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            assert len({len(d) for d in item.dims}) <= 1, name

    with h5py.File(file) as f:
        f.visititems(look)
        phi = f["speed_0/nd_0/modes/phi"]
        assert [d.label for d in phi.dims] == ["node", "axis", "mode"]


def test_text_is_of_fixed_length(file: Path) -> None:
    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            assert item.dtype.kind in "fiuS", name

    with h5py.File(file) as f:
        f.visititems(look)


def test_every_dataset_is_documented(file: Path) -> None:
    documented = set(re.findall(r"[A-Za-z_]\w*", PAGE.read_text(encoding="utf-8")))
    names: set[str] = set()
    with h5py.File(file) as f:
        f.visititems(lambda name, item: names.add(name.rsplit("/", 1)[-1]) if isinstance(item, h5py.Dataset) else None)
        names -= {*f["speed_0/nd_0/checks"], "tetra10", "triangle6"}
    assert names <= documented, names - documented


def test_the_documented_python_lines(file: Path) -> None:
    code = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert code is not None
    lines = code[1].replace('"basis.h5"', repr(str(file)))
    assert len([line for line in lines.splitlines() if line.strip()]) <= 15
    found: dict = {}
    exec(lines, found)
    group = read_basis(file).groups[0, 0]
    assert same(found["omega"], group.omega)
    assert same(found["phi"], group.phi)
    assert same(found["T"]["left"], group.interfaces["left"].rows)
    assert same(found["missing"], group.compliance.residual)
    assert same(found["stress"].astype(float), group.stresses["nodes"].stress)
    assert found["failed"] == []


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_the_documented_matlab_function(file: Path) -> None:
    ask = (
        f"addpath('{PAGE.parent}'); b = read_modal_file('{file}', 1, 'right');"
        "printf('%.17g ', b.omega(2), b.G_r(1, 2), b.phi(324, 1, 2), b.T(2, 3), b.xyz(324, 3), b.rotation(1, 1));"
    )
    done = subprocess.run(["octave-cli", "-q", "--eval", ask], capture_output=True, text=True, timeout=120)
    g = read_basis(file).groups[1, 0]
    right = g.interfaces["right"]
    expected = [g.omega[1], g.G_r[0, 1], g.phi[323, 0, 1], right.rows[1, 2], small.basis().mesh.points[323, 2]]
    assert [float(v) for v in done.stdout.split()] == [*expected, right.rotation[0, 0]], done.stderr


def opened(path: Path) -> Any:
    """The tree of a file, by xarray."""
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_datatree(path, engine="h5netcdf", phony_dims="sort") as tree:
        return tree.load()


def test_xarray_names_the_dimensions(file: Path) -> None:
    """As docs/modal_file.md says, of a body at speed."""
    tree = opened(file)
    assert tree["speed_0/nd_0/modes/phi"].dims == ("node", "axis", "mode")
    assert tree["speed_0/nd_0/stress/nodes/T"].dims == ("place", "component", "mode")
    assert tree["speed_1/nd_0/run_up/N"].dims == ("mode", "mode_column")


@pytest.mark.parametrize("name", [pytest.param("ring", marks=pytest.mark.slow), "masses"])
def test_xarray_opens_every_modal_file(name: str, tmp_path: Path) -> None:
    """A sector's complex groups and a small system too."""
    basis = sector.basis() if name == "ring" else system_basis(MASSES)
    write_basis(tmp_path / "basis.h5", basis)
    seen = opened(tmp_path / "basis.h5")
    for (_, k), g in basis.groups.items():
        np.testing.assert_array_equal(seen[f"speed_0/nd_{k}/modes/K_r"].values, g.K_r.real)


# ---------------------------------------------------------------- checks


@contextlib.contextmanager
def edited(path: Path) -> Iterator[h5py.File]:
    """The file open for changes. It is sealed again, or every reading would begin with a trial."""
    with h5py.File(path, "r+") as f:
        yield f
    seal(path)


def change(path: Path, place: str, how: Callable[[np.ndarray], np.ndarray]) -> None:
    with edited(path) as f:
        f[place][...] = how(f[place][...])


def scaled(factor: float, index: object) -> Callable[[np.ndarray], np.ndarray]:
    def apply(a: np.ndarray) -> np.ndarray:
        a[index] *= factor
        return a

    return apply


def swapped(a: np.ndarray) -> np.ndarray:
    a[[0, 1]] = a[[1, 0]]
    return a


def with_nan(a: np.ndarray) -> np.ndarray:
    a.flat[a.size // 2] = np.nan
    return a


AT = "speed_0/nd_0/"
TAMPERED = {
    "frequency": (AT + "modes/frequency", scaled(1.001, 2)),
    "omega": (AT + "modes/omega", scaled(1.001, 2)),
    "M_r": (AT + "modes/M_r", scaled(1.001, (1, 1))),
    "K_r": (AT + "modes/K_r", scaled(1.001, (1, 1))),
    "C_r": (AT + "modes/C_r", scaled(1.001, (1, 1))),
    "G_r": ("speed_1/nd_0/modes/G_r", scaled(1.001, (0, 1))),
    "one shape": (AT + "modes/phi", scaled(1.001, (..., 2))),
    "one node": (AT + "modes/phi", scaled(-1.0, (324,))),
    "nodes in another order": (AT + "modes/phi", lambda a: a[::-1]),
    "axes in another order": (AT + "modes/phi", lambda a: a[:, [1, 0, 2]]),
    "sign of one shape": (AT + "modes/phi", scaled(-1.0, (..., 2))),
    "interface rows swapped": (AT + "interfaces/right/T", swapped),
    "interface rotation row": (AT + "interfaces/left/T", scaled(1.001, 4)),
    "excitation rows": (AT + "excitation/shaker/T", scaled(-1.0, (0, 1))),
    "monitor rows swapped": (AT + "monitor/tip-probe/T", swapped),
    "frame": ("interfaces/right/rotation", swapped),
    "patch areas": ("interfaces/right/patch/areas", scaled(1.5, 3)),
    "modal compliance": (AT + "compliance_modal", scaled(1.001, (0, 0))),
    "eigenmodes alone": (AT + "compliance_plain", scaled(1.001, (0, 0))),
    "static compliance": (AT + "compliance_static", scaled(0.5, (13, 13))),
    "mass": ("body/mass", lambda a: a * 1.001),
    "one point of the mesh": ("mesh/xyz", scaled(1.5, 150)),
    "cells": ("mesh/cells/tetra10", lambda a: a[:, ::-1]),
    "certificate": (AT + "checks/certified", lambda a: a * 0),
    "backward error": (AT + "checks/backward_error", lambda a: a + 1e-3),
    "axis of rotation": ("rotation/direction", lambda a: a * 2),
}


TAMPERED |= {
    "one number of a shape": (AT + "modes/phi", scaled(1.001, (200, 1, 3))),
    "one number of a shape at speed": ("speed_1/nd_0/modes/phi", scaled(1.001, (200, 1, 3))),
    "one strain": (AT + "strain/gauss/T", scaled(1.001, (300, 2, 4))),
    "one strain at speed": ("speed_1/nd_0/strain/gauss/T", scaled(1.001, (300, 2, 4))),
    "one stress": (AT + "stress/gauss/T", scaled(1.001, (300, 2, 4))),
    "one smoothed stress": (AT + "stress/nodes/T", scaled(1.001, (200, 2, 4))),
    "static displacement of a node": ("speed_1/nd_0/rotation/u_static", scaled(1.001, (200, 2))),
    "one number of a load": (AT + "excitation/shaker/T", scaled(1.001, (0, 1))),
    "one number of a read-out": (AT + "monitor/tip-probe/T", scaled(1.001, (2, 5))),
    "origin of a patch": ("interfaces/left/origin", scaled(1.001, 2)),
    "normals": ("interfaces/left/patch/normals", lambda a: -a),
    "one normal": ("interfaces/left/patch/normals", scaled(-1.0, 3)),
    "outline": ("interfaces/left/patch/polygon", lambda a: 2 * a),
    "outline the other way round": ("interfaces/left/patch/polygon", lambda a: a[::-1]),
    "place of a load": (AT + "excitation/shaker/point", lambda a: 1.01 * a),
    "place of a pressure": (AT + "excitation/gas/point", lambda a: 1.5 * a),
    "place of a read-out": (AT + "monitor/tip-probe/point", scaled(1.01, 2)),
    "place of a gauge": (AT + "gauge/root/point", scaled(1.01, 0)),
    "strains of a gauge": (AT + "gauge/root/T", lambda a: 2 * a),
    "one strain of a gauge": (AT + "gauge/root/T", scaled(1.01, (0, 0))),
    "places of strains": (AT + "stress/gauss/points", scaled(1.01, (5, 2))),
}
"""What nothing but the seal guarded."""


@pytest.mark.parametrize("what", TAMPERED)
def test_tampered_content_is_found(copy: Path, what: str) -> None:
    change(copy, *TAMPERED[what])
    try:
        assert failed(read_basis(copy)) != []
    except UserError as error:
        assert "damaged" in str(error)


CLOSED = "of a closed contact: test_contact.py has the bodies that touch"
RANGE = "of a range of speeds: test_speed_range.py has one"
MATRICES = "kept by other reductions or foreign matrices: test_reduction.py, test_matrices.py"
UNGUARDED = {
    "Compliance.static": "of the unreduced body, whose K is not in the file: not below the modal one, and symmetric",
    "GyroscopicModes.growth": "0 of a stable body; that of an unstable one stands in its equation",
    "GyroscopicModes.sense": "a mean over the orbits, told and not used",
    "GyroscopicModes.error": "of the unreduced body, whose matrices are not in the file",
    "Rows.distance": "from the point asked for, which is not in the file",
    "StressSet.static_stress": "of the static state, whose temperature and law are not in the file",
    "StressSet.singular": "where pictures and fatigue do not look: a choice, of the settings",
    "Interface.characteristic": MATRICES, "Interface.pattern": MATRICES, "Invariants.stiffening": MATRICES,
    "ModalGroup.to_diagonal": MATRICES, "ModalGroup.N_r": MATRICES, "Residual.phi": MATRICES,
    **dict.fromkeys(("ContactState.normal_force", "ContactState.force", "ContactState.pressure"), CLOSED),
    **dict.fromkeys(("ContactState.centre", "ContactState.spread", "ContactState.closed_share"), CLOSED),
    "ContactState.penetration": f"a limit, no value; {CLOSED}",
    "ContactState.penalty": "chosen by the solver, of whose answer the penetration tells",
    "ContactState.interference": "of the settings; it limits the penetration",
    "ContactState.gap": "of the deformed faces, of which the other one's side is not in the state",
    "ContactState.points": "of the quadrature of the face at rest: not looked for yet",
    "ContactState.areas": f"no less than what carries the force; {CLOSED}",
    **dict.fromkeys(("SpeedRange.interpolation_error", "SpeedRange.total_error", "SpeedRange.held"), RANGE),
    **dict.fromkeys(("SpeedRange.slopes", "SpeedRange.shift"), RANGE),
    "SpeedRange.tolerance": f"what the total error is held to; {RANGE}",
    "SpeedRange.projection_error": "of the unreduced body at the held-out speeds, which is not in the file",
    "SpeedRange.solved": f"no sample is both solved for and held out; {RANGE}",
    "SpeedRange.lead": "read-outs that choose a basis within a pair: any will do",
    "SpeedRange.points": "speeds of a diagram: a choice",
}  # fmt: skip
"""What a change of one number by a hundredth is not looked for in, and why."""

NOUNS = (
    Compliance, ContactState, GyroscopicModes, Interface, Invariants, Mesh, ModalBasis, ModalGroup, Residual, Rows,
    RunUp, SpeedRange, StressSet,
)  # fmt: skip
ARRAYS = {
    f"{noun.__name__}.{field}": (noun, field)
    for noun in NOUNS
    for field, (_, kind) in declared(noun).items()
    if kind not in (str, int, bool, tuple[str, ...])
}


def replaced(thing: Any, noun: type, field: str, how: Callable[[np.ndarray], Any], done: list[str]) -> Any:
    """The thing with the first array of that field, that is not empty, changed; where it stands is added to done."""
    if done:
        return thing
    if isinstance(thing, Mapping):
        return {k: replaced(v, noun, field, how, done) for k, v in thing.items()}
    if isinstance(thing, tuple) and thing and dataclasses.is_dataclass(thing[0]):
        return tuple(replaced(v, noun, field, how, done) for v in thing)
    if not dataclasses.is_dataclass(thing) or isinstance(thing, type):
        return thing
    if type(thing) is noun and getattr(thing, field) is not None and np.any(getattr(thing, field)):
        done.append(field)
        return dataclasses.replace(thing, **{field: how(np.array(getattr(thing, field)))})
    new = {f.name: replaced(getattr(thing, f.name), noun, field, how, done) for f in dataclasses.fields(thing)}
    return dataclasses.replace(thing, **new) if done else thing


def by_a_hundredth(a: np.ndarray) -> Any:
    """The largest number 1 % larger; the first of a list of flags or counts another one."""
    if a.dtype.kind not in "fc":
        a.flat[0] = 1 - a.flat[0]
        return a
    a.flat[np.abs(a).argmax()] *= 1.01
    return a if a.shape else float(a)


@pytest.mark.parametrize("what", sorted(ARRAYS.keys() - UNGUARDED))
def test_every_array_of_the_format_is_guarded(what: str) -> None:
    """One number that is 1 % off is found in each that is not listed with a reason why it cannot be."""
    done: list[str] = []
    changed = replaced(small.basis((0.0, 3000.0)), *ARRAYS[what], by_a_hundredth, done)
    assert done and failed(changed)


@pytest.mark.parametrize("of", ["another law", "another modulus"])
def test_frequencies_that_are_not_those_of_the_shapes_are_found(of: str) -> None:
    """Consistent in all that the file says of them: a shape that is stiffer than the others says it is. That all are by
    one factor is another modulus, of which the file knows nothing."""
    g = small.basis().groups[0, 0]
    factor = np.full(g.n_modes, 1.001)
    factor[1:] = 1.0 if of == "another law" else 1.001
    one = dataclasses.replace(g, K_r=factor * g.K_r, omega=np.sqrt(factor) * g.omega, stresses={})
    limit, found = 1e-9, stiffness_error(small.basis(), one)  # over the highest: the first is far below it
    assert found is not None and found[1] == limit and (found[0] > 1e3 * limit) == (of == "another law")


def test_any_law_of_the_material_is_compared_and_a_changing_one_is_not() -> None:
    """An orthotropic one is known by its stresses; without them only an isotropic one is."""
    wood = {
        "density": 600.0, "young": [11e9, 0.9e9, 0.5e9], "poisson": [0.3, 0.4, 0.3], "shear": [0.7e9, 0.6e9, 0.1e9],
        "axes": [[1.0, 0.2, 0.0], [-0.2, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }  # fmt: skip
    basis = modal_basis(small.beam(), BodySettings.model_validate(small.table(material=wood)), provenance={})
    g = basis.groups[0, 0]
    assert stiffness_error(basis, g)[0] < 1e-10 and stress_error(basis, g) < 1e-10
    assert stiffness_error(basis, dataclasses.replace(g, stresses={})) is None
    warm = dataclasses.replace(basis, provenance={"settings": '{"temperature": {"file": "t.csv"}}'})
    assert stiffness_error(warm, g) is None and stress_error(warm, g) is None
    steel = small.basis()
    assert stiffness_error(steel, dataclasses.replace(steel.groups[0, 0], stresses={}))[0] < 1e-10


@pytest.mark.parametrize(
    "place",
    [
        AT + "modes/omega", AT + "modes/phi", AT + "modes/K_r", AT + "modes/damping_ratio", AT + "interfaces/right/T",
        AT + "interfaces/right/patch/shapes", AT + "interfaces/right/fit_residual", AT + "compliance_static",
        AT + "compliance_modal", AT + "stress/gauss/T", AT + "strain/nodes/T", AT + "rotation/u_static",
        AT + "gauge/root/T", AT + "rotation/sigma_static/nodes", "mesh/xyz", "body/inertia", "rotation/point",
        "interfaces/left/patch/normals", "interfaces/left/rotation", "interfaces/left/origin",
    ],
)  # fmt: skip
def test_not_a_number_is_found(copy: Path, place: str) -> None:
    change(copy, place, with_nan)
    try:
        assert failed(read_basis(copy)) != []
    except UserError as error:
        assert "damaged" in str(error)


def test_mass_from_the_mesh_needs_no_finite_element_package() -> None:
    basis = small.basis()
    inner, volume = modal_mass(basis.mesh, basis.groups[0, 0].phi)
    assert volume == pytest.approx(np.prod(small.SIZE), rel=1e-13)
    assert np.allclose(inner * basis.mass / volume, np.eye(6), rtol=0, atol=1e-13)


@pytest.mark.parametrize("cell_type", ["tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"])
def test_quadrature_of_the_checks_is_that_of_the_assembly(cell_type: str) -> None:
    pytest.importorskip("skfem")
    from microslip.basis.integrals import _rule, tables
    from microslip.fem.discretise import shape_functions

    points, _ = _rule(cell_type)
    N, dN, weights = tables(cell_type)
    expected_N, expected_dN = shape_functions(cell_type, points)
    assert np.allclose(N, expected_N, rtol=0, atol=1e-13)
    assert np.allclose(dN, expected_dN, rtol=0, atol=1e-12)
    assert weights.sum() == pytest.approx(1 / 6 if "tetra" in cell_type else 1.0, rel=1e-14)


@pytest.mark.parametrize("factor", [0.0, 1e-200, 1e200, 1e307])
def test_absurd_numbers_are_findings_and_no_exceptions(factor: float) -> None:
    """Whose squares overflow or vanish, in every part."""
    basis, g = small.basis((0.0, 3000.0)), small.basis((0.0, 3000.0)).groups[0, 0]
    assert g.invariants is not None
    v = g.invariants
    with np.errstate(over="ignore"):
        K, omega = g.K_r * factor, g.omega * factor
    groups = [
        dataclasses.replace(g, omega=omega, K_r=K),
        dataclasses.replace(g, phi=g.phi * factor),
        dataclasses.replace(g, invariants=dataclasses.replace(v, mass=v.mass * factor)),
        dataclasses.replace(g, invariants=dataclasses.replace(v, point=v.point * factor + factor)),
    ]
    wrong = [dataclasses.replace(basis, groups={**basis.groups, (0, 0): changed}) for changed in groups]
    mesh = dataclasses.replace(basis.mesh, points=basis.mesh.points * factor)
    wrong += [dataclasses.replace(basis, mesh=mesh), dataclasses.replace(basis, mass=basis.mass * factor)]
    for changed in wrong:
        assert failed(changed)


def test_checks_do_not_raise_on_arrays_that_do_not_fit() -> None:
    basis = small.basis()
    group = basis.groups[0, 0]
    for field, value in {
        "M_r": np.zeros((0, 0)), "phi": np.zeros((7, 3, 6)), "kind": ("normal",), "u_static": np.zeros(3),
        "damping_ratio": np.zeros(2),
    }.items():  # fmt: skip
        broken = dataclasses.replace(basis, groups={(0, 0): dataclasses.replace(group, **{field: value})})
        assert any("shapes" in name for name in failed(broken)), field
    labels = ("interface:nowhere:u_n", *group.compliance.labels[1:])
    renamed = dataclasses.replace(group, compliance=dataclasses.replace(group.compliance, labels=labels))
    assert any("compliance rows" in name for name in failed(dataclasses.replace(basis, groups={(0, 0): renamed})))
    no_cells = dataclasses.replace(basis, mesh=Mesh(basis.mesh.points, {}))
    assert any("mesh" in name for name in failed(no_cells))


# ---------------------------------------------------------------- damage


def refusal(path: Path) -> str:
    return refused(str(path), read_basis, path)


@pytest.mark.usefixtures("untried")
def test_missing_foreign_and_text_files(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("hello")
    (tmp_path / "empty.h5").write_bytes(b"")
    with h5py.File(tmp_path / "other.h5", "w") as f:
        f["x"] = 1.0
    told = {"none": "no such modal file", "text": "no HDF5", "empty": "no HDF5", "other": "is no modal file"}
    for name, words in told.items():
        assert words in refusal(tmp_path / f"{name}.h5")
    assert "is a folder" in refusal(tmp_path)


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize("share", [0.3, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.0001, 0.01, 0.7, 0.99))])
def test_truncated_files(copy: Path, share: float) -> None:
    data = copy.read_bytes()
    copy.write_bytes(data[: int(share * len(data))])
    assert "damaged" in refusal(copy)


@pytest.mark.usefixtures("untried")
def test_a_cut_seal_leaves_a_readable_file(copy: Path) -> None:
    copy.write_bytes(copy.read_bytes()[:-10])
    assert seal_state(copy) == "absent"
    assert failed(read_basis(copy)) == []


@pytest.mark.slow
def test_another_program_may_change_the_file(copy: Path) -> None:
    with h5py.File(copy, "r+") as f:
        f["mine"] = [1.0, 2.0]
    assert seal_state(copy) == "absent"
    assert failed(read_basis(copy)) == []


def test_files_without_a_seal_are_tried_in_a_process_of_their_own(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert trial("path.read_bytes()", copy) == ""
    assert trial("raise ValueError", copy) == ""
    assert trial("import os; os.abort()", copy) == "crashes"
    package = "import os, sys; os.path.isfile(sys.path[0] + '/microslip/files/hostile.py') and os.abort()"
    assert trial(package, copy) == "crashes"  # so the trial knows this package, installed or not
    assert trial("while True: pass", copy, seconds=1.0) == "does not come to an end"
    assert trial("raise MemoryError", copy) == "wants too much memory"
    monkeypatch.setattr("microslip.basis.files._TRIAL", "import os; os.abort()")
    assert failed(read_basis(copy)) == []  # sealed: no trial
    copy.write_bytes(copy.read_bytes()[:-10])
    assert "HDF5 crashes on it" in refusal(copy)


def test_any_flipped_byte_breaks_the_seal(copy: Path) -> None:
    data = copy.read_bytes()
    assert seal_state(copy) == "intact"
    for place in np.random.default_rng(0).integers(0, len(data) - 200, 20):
        flipped = bytearray(data)
        flipped[place] ^= 0x10
        copy.write_bytes(flipped)
        assert "sealed" in refusal(copy)


@pytest.mark.parametrize(("place", "name", "value"), [("/", "format_version", "7.1"), ("cyclic", "N", 0)])
def test_another_version_and_an_impossible_number_of_sectors(copy: Path, place: str, name: str, value: Any) -> None:
    with edited(copy) as f:
        f[place].attrs[name] = value
    assert (place if place != "/" else value) in refusal(copy)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_every_missing_part_is_named(tmp_path: Path, step: int) -> None:
    path = tmp_path / "basis.h5"
    write_basis(path, small.basis())
    parts = ["mesh/" + p for p in ("node", "xyz", "cells", "groups", "groups/tip/nodes")]
    parts += ["body/" + p for p in ("mass", "centre", "inertia")]
    parts += ["cyclic", "provenance", "rotation/direction", "rotation/point", "speed_0", "interfaces"]
    parts += ["interfaces/left/" + p for p in ("origin", "rotation", "patch/points", "patch/areas", "patch/normals")]
    parts += [f"{AT}modes/{p}" for p in ("omega", "frequency", "damping_ratio", "kind", "M_r", "K_r", "C_r", "G_r")]
    parts += [AT + p for p in ("modes", "rotation", "rotation/u_static", "checks", "excitation", "monitor", "gauge")]
    parts += [AT + p for p in ("interfaces/right", "interfaces/right/T", "interfaces/right/fit_residual")]
    parts += [AT + "monitor/tip-probe/" + p for p in ("T", "row", "static", "point")]
    parts += [AT + p for p in ("compliance_static", "compliance_modal", "compliance_plain", "compliance_row", "cyclic")]
    parts += [AT + p for p in ("stress/gauss/T", "stress/gauss/points", "stress/gauss/weights", "strain/gauss/T")]
    parts += [AT + p for p in ("rotation/sigma_static/gauss", "strain")]
    for part in parts[::step]:
        with edited(path) as f:
            f.move(part, "elsewhere")
        assert "damaged or incomplete" in refusal(path), part
        with edited(path) as f:
            f.move("elsewhere", part)
    assert failed(read_basis(path)) == []


def test_hostile_content_is_refused_before_it_is_read(copy: Path, tmp_path: Path) -> None:
    def soft(f: h5py.File) -> None:
        f["body/extra"] = h5py.SoftLink("/mesh/xyz")

    def external(f: h5py.File) -> None:
        f["body/extra"] = h5py.ExternalLink("/etc/passwd", "/")

    def circle(f: h5py.File) -> None:
        f["body/extra"] = f["/"]

    def huge(f: h5py.File) -> None:
        f["body"].create_dataset("extra", shape=(10**15,), dtype="f8", chunks=(1024,))

    def objects(f: h5py.File) -> None:
        f["body"].create_dataset("extra", data=["a", "b"], dtype=h5py.string_dtype())

    def references(f: h5py.File) -> None:
        f["body"].create_dataset("extra", data=f["body"].ref, dtype=h5py.ref_dtype)

    def elsewhere(f: h5py.File) -> None:
        f["body"].create_dataset("extra", shape=(3,), dtype="f8", external=[("/etc/passwd", 0, 24)])

    def virtual(f: h5py.File) -> None:
        layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
        layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=(3,))
        f["body"].create_virtual_dataset("extra", layout)

    def named_type(f: h5py.File) -> None:
        f["body/extra"] = np.dtype("f8")

    for trick in (soft, external, circle, huge, objects, references, elsewhere, virtual, named_type):
        path = Path(shutil.copy(copy, tmp_path / f"{trick.__name__}.h5"))
        with edited(path) as f:
            trick(f)
        assert "body/extra" in refusal(path) or trick is circle, trick.__name__
        with h5py.File(path) as f, pytest.raises(HostileFile):
            inspect(f)


@pytest.mark.usefixtures("untried")
def test_open_file_leaves_nothing_open(copy: Path) -> None:
    with h5py.File(copy, "r+") as f:
        f.attrs["format_version"] = "7.1"
    refused((), open_file, copy)
    with h5py.File(copy, "r+"):  # a file still open for reading could not be opened for writing
        pass


@pytest.mark.parametrize(
    "reduction", ["eigenmodes", *(pytest.param(r, marks=pytest.mark.slow) for r in ("rubin", "massless-boundary"))]
)
def test_a_band_below_the_first_elastic_mode_keeps_the_rigid_motions(reduction: str) -> None:
    """It was refused. All that is missing stands in the compliance; a held body has nothing in such a band."""
    modes = {"count": 12, "max_frequency": 10.0, "solver": "superlu"}
    table = small.table(free=True, reduction=reduction, modes=modes)
    del table["supports"]
    basis = modal_basis(small.beam((1, 1, 2)), BodySettings.model_validate(table))
    group = basis.groups[0, 0]
    assert (group.omega[:6] == 0).all() and "normal" not in group.kind
    assert all(c.passed for c in check_basis(basis)) and not group.compliance.plain.any()
    with pytest.raises(UserError, match="modes.max_frequency"):
        modal_basis(small.beam((1, 1, 2)), BodySettings.model_validate(small.table(modes=modes)))
