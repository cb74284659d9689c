"""The conformance kit: schema, validator and answers against what microslip writes, planted errors, hostile files."""

from __future__ import annotations

import ast
import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.linalg

ROOT = Path(__file__).resolve().parents[1]
KIT = ROOT / "conformance"
sys.path.insert(0, str(KIT))

import bodies  # noqa: E402
import make  # noqa: E402
import validate  # noqa: E402
from refusals import refused  # noqa: E402

from microslip.basis import FORMAT, FORMAT_VERSION, check_basis, read_basis, write_basis  # noqa: E402
from microslip.cli import main  # noqa: E402
from microslip.data import Material, ModalBasis  # noqa: E402
from microslip.files.hdf5 import seal  # noqa: E402
from microslip.modal.compute import modal_basis  # noqa: E402

SMALL = [n for n in bodies.SAMPLES if n not in bodies.LARGE]
SCHEMA = validate.known_schema()


@cache
def built(name: str) -> ModalBasis:
    return bodies.SAMPLES[name]()


def massless() -> ModalBasis:
    """Fewer modes than coordinates."""
    settings = bodies.vane_settings("massless", reduction="massless-boundary", output={"gauss": False})
    return modal_basis(bodies.vane((1, 1, 3), 0.4), settings)


def macneal() -> ModalBasis:
    """Residual shapes and stresses beside the modes."""
    gauge = {"name": "root", "point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]}
    settings = bodies.vane_settings("macneal", reduction="macneal", gauges=[gauge], output={"gauss": True})
    return modal_basis(bodies.vane((1, 1, 3), 0.4), settings)


def two_materials() -> ModalBasis:
    """A mesh that brings its materials, both of the same numbers."""
    basis = built("vane-eigenmodes")
    steel = bodies.vane_settings("x").material.material()
    cells = basis.mesh.cells["hexahedron20"]
    mesh = dataclasses.replace(
        basis.mesh, materials=(steel, Material(steel.density, steel.elasticity, steel.expansion, None, "again")),
        regions={"hexahedron20": np.arange(len(cells)) % 2},
    )  # fmt: skip
    return dataclasses.replace(basis, mesh=mesh)


def every_kind(folder: Path) -> list[Path]:
    """A file of everything the format knows."""
    found = []
    for name in bodies.SAMPLES:
        write_basis(folder / f"{name}.h5", built(name))
        found.append(folder / f"{name}.h5")
    for name, basis in (("massless", massless()), ("macneal", macneal()), ("materials", two_materials())):
        write_basis(folder / f"{name}.h5", basis)
        found.append(folder / f"{name}.h5")
    return found


# ---------------------------------------------------------------- the schema is what is written


def test_a_small_file_of_each_sample_conforms(tmp_path: Path) -> None:
    for name in SMALL:
        write_basis(tmp_path / f"{name}.h5", built(name))
        assert validate.validate(tmp_path / f"{name}.h5") == [], name


@pytest.mark.slow
def test_the_schema_and_the_writer_say_the_same(tmp_path: Path) -> None:
    """Every file conforms, and every entry of the schema stands in one of them."""
    assert (SCHEMA.table["format"], SCHEMA.table["format_version"]) == (FORMAT, FORMAT_VERSION)
    met = set()
    for path in every_kind(tmp_path):
        assert validate.validate(path) == [], path.name
        assert [c.name for c in check_basis(read_basis(path)) if not c.passed] == []
        with h5py.File(path) as file:
            for place in ["/", *validate.inspect(file, path.stat().st_size)]:
                name = place[:-5] if validate._is_imaginary(file, place) else place
                for path_in in (name, *(f"{place}@{a}" for a in file[place].attrs)):
                    entry = SCHEMA.find(path_in, "@" in path_in)[1]
                    met |= {entry["path"]} if entry else set()
    assert set(SCHEMA.entries) - met == set()


def test_every_entry_of_the_schema_is_documented() -> None:
    page = (ROOT / "docs" / "modal_file.md").read_text(encoding="utf-8")
    names = {p.replace("@", "/").rsplit("/", 1)[-1] for p in SCHEMA.entries}
    scales = {"corner", "point", "shape", "place", "whirl", "mode_column", "row", "compliance_column"}
    plain = {n for n in names if "<" not in n} - scales - {"S"}
    assert {n for n in plain if n not in page} == set()


def test_the_validator_needs_nothing_but_h5py_and_numpy() -> None:
    tree = ast.parse((KIT / "validate.py").read_text(encoding="utf-8"))
    names = {a.name.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {n.module.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module}
    assert names - set(sys.stdlib_module_names) == {"h5py", "numpy"}
    assert "pickle" not in names


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment with h5py and numpy and nothing else."""
    folder = tmp_path_factory.mktemp("bare") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (site,) = folder.glob("[Ll]ib/**/site-packages")
    for package in (h5py, np):
        place = Path(package.__file__).parent
        for part in (place, place.with_name(f"{place.name}.libs")):
            if part.exists():
                shutil.copytree(part, site / part.name, symlinks=True, ignore=shutil.ignore_patterns("tests"))
    return next(folder.glob("[bS]*/python*"))


@pytest.mark.parametrize(
    "name", [n if n == "sector-cyclic" else pytest.param(n, marks=pytest.mark.slow) for n in SMALL]
)
def test_the_validator_runs_where_there_is_only_h5py_and_numpy(name: str, bare: Path, tmp_path: Path) -> None:
    """The kit without the scripts that make it, in an environment without microslip, scipy or any other package."""
    kit = shutil.copytree(KIT, tmp_path / "kit", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    shutil.copy(KIT / "validate.py", kit)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def asked(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(bare), *words], cwd=kit, env=environment, capture_output=True, text=True, timeout=120
        )  # fmt: skip

    assert "No module named 'scipy'" in asked("-c", "import scipy").stderr
    done = asked("validate.py", f"samples/{name}.h5", "--answers", f"answers/{name}.json")
    assert done.returncode == 0 and "conforms and its answers agree" in done.stdout, done.stdout + done.stderr


# ---------------------------------------------------------------- samples and answers


def numbers(path: Path) -> dict[str, Any]:
    out = {}
    with h5py.File(path) as file:
        file.visititems(lambda n, i: out.update({n: i[()]}) if isinstance(i, h5py.Dataset) else None)
    return out


@pytest.mark.parametrize("name", SMALL)
def test_samples_are_those_the_script_makes(tmp_path: Path, name: str) -> None:
    """Twice the same bytes here; on another machine the same numbers to 1e-7 of the largest of each dataset, errors and
    residuals of rounding apart. After a change of the format: python conformance/make.py."""
    basis = built(name)
    for copy, made_now in (("a", basis), ("b", bodies.SAMPLES[name]())):
        write_basis(tmp_path / f"{copy}.h5", made_now)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    kept, made = numbers(KIT / "samples" / f"{name}.h5"), numbers(tmp_path / "a.h5")
    assert set(kept) == set(made)
    for key, old in kept.items():
        if old.dtype.kind == "f" and "/checks/" not in key and not key.endswith("fit_residual"):
            top = max(np.abs(old).max(initial=0.0), 1e-12)
            base = kept.get(key.removesuffix("_imag"), old)  # a part that vanishes is measured by the other one
            np.testing.assert_allclose(made[key], old, rtol=0, atol=1e-7 * max(top, np.abs(base).max(initial=0.0)))
        elif old.dtype.kind != "f":
            assert (made[key] == old).all()
    make.write_answers(tmp_path / "answers.json", basis)
    with h5py.File(KIT / "samples" / f"{name}.h5") as file:
        assert validate.check_answers(file, tmp_path / "answers.json") == []


@pytest.mark.parametrize("name", SMALL)
def test_answers_kept_with_the_samples(name: str) -> None:
    """By direct solution (the validator), while they were made by modal superposition."""
    assert validate.validate(KIT / "samples" / f"{name}.h5", KIT / "answers" / f"{name}.json") == []


def test_wrong_answers_are_found(tmp_path: Path) -> None:
    """Damping of the wrong sign, a load not conjugated, degrees for radians: each is far beyond the tolerance."""
    told = json.loads((KIT / "answers" / "sector-cyclic.json").read_text())
    for change in (lambda a: a | {"imag": [-v for v in a["imag"]]}, lambda a: a | {"real": [2 * v for v in a["real"]]}):
        wrong = told | {"answers": [change(a) for a in told["answers"]]}
        (tmp_path / "a.json").write_text(json.dumps(wrong))
        found = validate.validate(KIT / "samples" / "sector-cyclic.h5", tmp_path / "a.json")
        assert len(found) > 10 and "off by" in found[0]
    with h5py.File(KIT / "samples" / "sector-cyclic.h5") as file:
        asked = next(a for a in told["answers"] if a["nodal_diameter"] == 1 and a["kind"] == "response")
        g = file["speed_0/nd_1"]
        right = validate.answer(file, asked)
        load = validate.row_of(g, asked["load"])  # not conjugated
        K, M, C = (validate.get(g["modes"], n) for n in ("K_r", "M_r", "C_r"))
        w = 2 * np.pi * np.array(asked["frequency_Hz"])
        slip = [validate.row_of(g, asked["read"]) @ np.linalg.solve(K - v**2 * M + 1j * v * C, load) for v in w]
        assert np.abs(slip - right).max() > 1e-3 * np.abs(right).max()
    (tmp_path / "b.json").write_text('{"answers": 3}')
    with pytest.raises(validate.Refused, match="no list of answers"):
        validate.validate(KIT / "samples" / "sector-cyclic.h5", tmp_path / "b.json")


@pytest.mark.parametrize("name", bodies.LARGE)
def test_answers_of_the_large_samples_hold(tmp_path: Path, name: str) -> None:
    """They are made on the spot; every state of them is asked for a response and for static answers."""
    write_basis(tmp_path / "a.h5", built(name))
    make.write_answers(tmp_path / "a.json", built(name))
    assert validate.validate(tmp_path / "a.h5", tmp_path / "a.json") == []
    told = json.loads((tmp_path / "a.json").read_text())["answers"]
    for speed, harmonic in built(name).groups:
        of_state = [a["kind"] for a in told if (a["speed"], a["nodal_diameter"]) == (speed, harmonic)]
        assert {"response", "static"} <= set(of_state)


@pytest.mark.parametrize("name", SMALL)
def test_each_sample_has_a_response_and_static_answers_with_a_tolerance(name: str) -> None:
    told = json.loads((KIT / "answers" / f"{name}.json").read_text())
    assert told["sample"] == f"{name}.h5" and 0 < told["tolerance"] <= 1e-7
    for key in built(name).groups:
        mine = [a for a in told["answers"] if (a["speed"], a["nodal_diameter"]) == key]
        assert any(a["kind"] == "response" and len(a["frequency_Hz"]) >= 10 and max(a["real"]) > 0 for a in mine)
        assert any(a["kind"] == "static" and a["real"][0] != 0 for a in mine)


def test_answers_of_two_masses_by_hand() -> None:
    """A force on the first mass moves the second by 1/k1 at rest; at w by two equations written out here, with the
    modal damping 2 D M sqrt(M^-1 K) beside the damper."""
    told = json.loads((KIT / "answers" / "two-masses.json").read_text())["answers"]
    (static,) = [a for a in told if a["kind"] == "static" and a["load"] == "excitation:shaker:force"]
    assert static["real"] == pytest.approx([1e-4], rel=1e-12)
    M, K = np.diag([1.0, 2.0]), np.array([[3e4, -2e4], [-2e4, 2e4]])
    C = np.array([[3.0, -3.0], [-3.0, 3.0]]) + 2 * 0.005 * M @ scipy.linalg.sqrtm(np.linalg.solve(M, K))
    (asked,) = [a for a in told if a["kind"] == "response" and a["read"] == "monitor:end:u_x"]
    for f, re_, im in zip(asked["frequency_Hz"], asked["real"], asked["imag"], strict=True):
        w = 2 * np.pi * f
        q = np.linalg.solve(K - w**2 * M + 1j * w * C, [1.0, 0.0])
        assert re_ + 1j * im == pytest.approx(q[1], rel=1e-9)


def test_craig_bampton_answers_at_the_contacts_are_those_of_the_full_model() -> None:
    """Its static answers among the interfaces are exact: the reduced K against `compliance_static` of the full one."""
    with h5py.File(KIT / "samples" / "vane-craig-bampton.h5") as file:
        g = file["speed_0/nd_0"]
        T = validate.compliance_rows(g)
        at = [i for i, n in enumerate(validate.text(g, "compliance_row")) if n.startswith("interface:")]
        held = T[at] @ np.linalg.solve(g["modes/K_r"][()], T[at].T)
        full = g["compliance_static"][()][np.ix_(at, at)]
    d = np.sqrt(np.diag(full))
    assert np.abs((held - full) / np.outer(d, d)).max() < 1e-8  # rounding of the stiffness, see make.TOLERANCE


# ---------------------------------------------------------------- planted errors


def put(file: h5py.File, name: str, data: np.ndarray) -> None:
    """Replace a dataset by another one with its attributes and labels."""
    old = file[name]
    labels = [d.label for d in old.dims]
    kept = {k: v for k, v in old.attrs.items() if k in ("unit", "inertia_relief")}
    del file[name]
    new = file.create_dataset(name, data=data)
    for key, value in kept.items():
        new.attrs[key] = value
    for i, label in enumerate(labels[: data.ndim]):
        new.dims[i].label = label


def order_of_nodes(file: h5py.File) -> None:
    phi = file["speed_0/nd_0/modes/phi"][()]
    put(file, "speed_0/nd_0/modes/phi", phi[::-1])


def other_brick(file: h5py.File) -> None:
    """gmsh's order of the mid-side nodes instead of VTK's."""
    cells = file["mesh/cells/hexahedron20"][()]
    put(file, "mesh/cells/hexahedron20", cells[:, [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]])


def order_of_rows(file: h5py.File) -> None:
    T = file["speed_0/nd_0/interfaces/right/T"][()]
    put(file, "speed_0/nd_0/interfaces/right/T", T[[1, 2, 0, 3, 4, 5]])


def rotations_first(file: h5py.File) -> None:
    T = file["speed_0/nd_0/interfaces/left/T"][()]
    put(file, "speed_0/nd_0/interfaces/left/T", T[[3, 4, 5, 0, 1, 2]])


def degrees(file: h5py.File) -> None:
    T = file["speed_0/nd_0/interfaces/left/T"][()]
    T[3:] *= 180 / np.pi
    put(file, "speed_0/nd_0/interfaces/left/T", T)


def millimetres(file: h5py.File) -> None:
    put(file, "mesh/xyz", 1000 * file["mesh/xyz"][()])


def hertz(file: h5py.File) -> None:
    modes = file["speed_0/nd_0/modes"]
    put(file, "speed_0/nd_0/modes/omega", modes["frequency"][()])


def scaled(file: h5py.File) -> None:
    put(file, "speed_0/nd_0/modes/phi", 31.6 * file["speed_0/nd_0/modes/phi"][()])


def transposed(file: h5py.File) -> None:
    T = file["speed_0/nd_0/interfaces/right/T"][()]
    put(file, "speed_0/nd_0/interfaces/right/T", T.T)
    for axis, label in enumerate(("mode", "interface_row")):
        file["speed_0/nd_0/interfaces/right/T"].dims[axis].label = label


def quietly_transposed(file: h5py.File) -> None:
    """Six modes and six rows: no shape tells it."""
    put(file, "speed_0/nd_0/interfaces/right/T", file["speed_0/nd_0/interfaces/right/T"][()].T)


def reversed_axes(file: h5py.File) -> None:
    """As MATLAB writes them."""
    put(file, "speed_0/nd_0/modes/phi", file["speed_0/nd_0/modes/phi"][()].transpose(2, 1, 0))


def unsorted(file: h5py.File) -> None:
    for name in ("omega", "frequency", "damping_ratio"):
        put(file, f"speed_0/nd_0/modes/{name}", file[f"speed_0/nd_0/modes/{name}"][()][::-1])
    K = file["speed_0/nd_0/modes/K_r"][()]
    put(file, "speed_0/nd_0/modes/K_r", K[::-1, ::-1])


def left_handed(file: h5py.File) -> None:
    R = file["interfaces/right/rotation"][()]
    put(file, "interfaces/right/rotation", R[[0, 2, 1]])


def negative_damping(file: h5py.File) -> None:
    put(file, "speed_0/nd_0/modes/C_r", -file["speed_0/nd_0/modes/C_r"][()])


def half_compliance(file: h5py.File) -> None:
    put(file, "speed_0/nd_0/compliance_static", 0.5 * file["speed_0/nd_0/compliance_static"][()])


def not_a_number(file: h5py.File) -> None:
    file["speed_0/nd_0/modes/phi"][3, 1, 2] = np.nan


def drop(name: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]

    return change


def attribute(place: str, name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file[place].attrs[name] = value

    return change


def single(file: h5py.File) -> None:
    put(file, "mesh/xyz", file["mesh/xyz"][()].astype(np.float32))


PLANTED: list[tuple[Callable[[h5py.File], None], str]] = [
    (order_of_nodes, "order of the nodes"),
    (other_brick, "positive volume|order of the nodes"),
    (order_of_rows, "mean motion"),
    (rotations_first, "mean motion"),
    (degrees, "best fit"),
    (millimetres, "is it in metres"),
    (hertz, "omega / 2 pi"),
    (scaled, "M_r on the mesh"),
    (transposed, "is it transposed"),
    (quietly_transposed, "mean motion"),
    (reversed_axes, "entries, but|must have 3"),
    (unsorted, "ascends"),
    (left_handed, "right-handed"),
    (negative_damping, "2 D omega"),
    (half_compliance, "not below"),
    (not_a_number, "finite"),
    (single, "64-bit float"),
    (drop("body/mass"), "lacks mass"),
    (drop("speed_0/nd_0/modes/C_r"), "lacks C_r"),
    (drop("speed_0/nd_0/compliance_row"), "lacks compliance_row"),
    (drop("interfaces/left/rotation"), "lacks rotation"),
    (drop("speed_0/nd_0"), "no group speed_0/nd_0"),
    (attribute("mesh/xyz", "unit", "mm"), "its unit is 'mm'"),
    (attribute("speed_0/nd_0/modes/omega", "unit", "Hz"), "its unit is 'Hz'"),
    (attribute("/", "units", "mm, t, s"), "must be one of 'SI"),
    (attribute("interfaces/right", "role", "upper"), "'upper'"),
    (attribute("interfaces/right", "sector_shift", 1.0), "must be integer"),
    (attribute("/", "extra", 1), "no part of the format"),
    (lambda f: f.create_dataset("speed_0/nd_0/modes/more", data=1.0), "no part of the format"),
    (lambda f: f.create_dataset("body/mass_imag", data=1.0), "may be complex"),
]


@pytest.mark.parametrize("number", range(len(PLANTED)))
def test_planted_errors_are_found(tmp_path: Path, number: int) -> None:
    change, words = PLANTED[number]
    path = Path(shutil.copy(KIT / "samples" / "vane-eigenmodes.h5", tmp_path / "a.h5"))
    with h5py.File(path, "r+") as file:
        change(file)
    found = "\n".join(validate.validate(path))
    assert re.search(words, found), found


def test_a_broken_seal_is_found(tmp_path: Path) -> None:
    data = bytearray((KIT / "samples" / "three-masses.h5").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "a.h5").write_bytes(data)
    done = run(tmp_path / "a.h5")
    assert done.returncode in (1, 2) and ("seal" in done.stdout or "refused" in done.stdout)


# ---------------------------------------------------------------- hostile files


def run(path: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-I", str(KIT / "validate.py"), str(path)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def external(file: h5py.File) -> None:
    del file["body/mass"]
    file["body/mass"] = h5py.ExternalLink("/etc/passwd", "/x")


def soft(file: h5py.File) -> None:
    file["body/again"] = h5py.SoftLink("/body")


def circle(file: h5py.File) -> None:
    file["body/again"] = file["body"]


def bomb(file: h5py.File) -> None:
    del file["mesh/xyz"]
    file.create_dataset("mesh/xyz", shape=(1 << 40, 3), dtype="f8", chunks=(1 << 16, 3), compression="gzip")


def elsewhere(file: h5py.File) -> None:
    del file["mesh/xyz"]
    file.create_dataset("mesh/xyz", shape=(2, 3), dtype="f8", external=[("/etc/passwd", 0, 48)])


def borrowed(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(108, 3), dtype="f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=(108, 3))
    del file["mesh/xyz"]
    file.create_virtual_dataset("mesh/xyz", layout)


def objects(file: h5py.File) -> None:
    """A pickle in an opaque type, which nothing may load."""
    import pickle

    data = np.void(pickle.dumps(print))
    del file["body/mass"]
    file.create_dataset("body/mass", data=data)


def long_text(file: h5py.File) -> None:
    file.create_dataset("body/text", data=["a", "b"], dtype=h5py.string_dtype())


@pytest.mark.parametrize("change", [external, soft, circle, bomb, elsewhere, borrowed, objects, long_text])
def test_hostile_content_is_refused_before_it_is_read(
    tmp_path: Path, change: Callable[[h5py.File], None], capfd: pytest.CaptureFixture[str]
) -> None:
    """By the validator and by microslip, in words."""
    path = Path(shutil.copy(KIT / "samples" / "vane-eigenmodes.h5", tmp_path / "a.h5"))
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(validate.Refused):
        validate.validate(path)
    seal(path)  # so that microslip opens it without a trial
    refused((), read_basis, path)


@pytest.mark.slow
def test_flipped_bytes_end_in_words(tmp_path: Path) -> None:
    """Without a seal: 0, 1 or 2 and a line of text, never a traceback, a crash or a hang."""
    whole = (KIT / "samples" / "three-masses.h5").read_bytes()
    body = bytearray(whole[: whole.rindex(validate.SEAL)])
    random = np.random.default_rng(0)
    refused = 0
    for trial in range(8):
        data = body.copy()
        for place in random.integers(0, len(data) if trial % 2 else 4096, 12):
            data[place] ^= 1 << int(random.integers(8))
        path = tmp_path / "a.h5"
        path.write_bytes(data[: len(data) // (trial + 1)] if trial == 6 else data)
        done = run(path)
        assert done.returncode in (0, 1, 2) and done.stdout.strip() and "Traceback" not in done.stdout + done.stderr
        refused += done.returncode == 2
    assert refused


def test_no_file_and_no_modal_file(tmp_path: Path) -> None:
    assert run(tmp_path / "none.h5").returncode == 2
    (tmp_path / "text.h5").write_text("no HDF5")
    assert run(tmp_path / "text.h5").returncode == 2
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    assert "format" in run(tmp_path / "other.h5").stdout


# ---------------------------------------------------------------- the sample that travels with the package


def test_the_packages_sample_is_the_kits() -> None:
    path = ROOT / "pipeline/microslip/samples/basis.h5"
    assert path.read_bytes() == (KIT / "samples" / f"{make.SAMPLE}.h5").read_bytes()
    assert path.stat().st_size < 500_000


BLOCK = """
import sys
class Absent:
    names = {"gmsh", "skfem", "meshio", "qdldl", "pypardiso", "pyvista", "vtk", "vtkmodules", "imageio", "pyyeti"}
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in self.names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
"""


@pytest.mark.slow
def test_the_sample_from_a_wheel_without_mesher_or_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new environment with the wheel and what the base install and [solve] need: from nothing to a friction response
    in one command within a minute of CPU time, nothing compiled before; a copy of one's own says the same about its
    first resonance, compiled as tests are."""
    import resource
    import sysconfig

    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "venv")], check=True)
    (site,) = (tmp_path / "venv").glob("lib/python*/site-packages")
    shutil.unpack_archive(wheel, site, "zip")
    (site / "sitecustomize.py").write_text(BLOCK)
    own = [p for p in {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}]
    (site / "later.pth").write_text("\n".join(own) + "\n")  # behind the wheel's own folder
    python = tmp_path / "venv" / "bin" / "python"
    (tmp_path / "work").mkdir()
    show = [str(python), "-c", "import microslip; print(microslip.__file__)"]
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "OMP_NUM_THREADS": "1"}
    where = subprocess.run(show, cwd=tmp_path / "work", env=environment, capture_output=True, text=True, check=True)
    assert str(site) in where.stdout
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        [str(python), "-m", "microslip", "respond", "sample"], cwd=tmp_path / "work", env=environment,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "work/build/sample/response.csv").is_file()
    assert (tmp_path / "work/build/sample/pictures/response.png").is_file()
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 60
    told = json.loads((tmp_path / "work/build/sample/response.json").read_text())
    peaks = {(r["normal_force_N"]): r["frequency_Hz"] for r in told["resonances"]}
    assert peaks[1000.0] == pytest.approx(told["stuck_frequencies_Hz"][0], rel=1e-4)  # sticking
    assert 270.93 < peaks[20.0] < peaks[100.0] < peaks[1000.0]  # the first frequency of the free vane
    monkeypatch.chdir(tmp_path)
    assert main(["init", "sample", "mine"]) == 0
    assert main(["respond", "mine", "-q", "--set", "sweep.stop=400", "--set", "sweep.points=26"]) == 0
    theirs, ours = (
        np.genfromtxt(tmp_path / file, delimiter=",", names=True, dtype=None, encoding="utf-8")
        for file in ("work/build/sample/response.csv", "build/mine/response.csv")
    )
    assert theirs.dtype == ours.dtype and len(theirs) > 50
    theirs, ours = (table[(table["asked"] == 1) & (table["frequency_Hz"] <= 400)] for table in (theirs, ours))
    assert len(theirs) == len(ours) == 26
    for kind in ("amplitude", "dissipated"):
        columns = [c for c in theirs.dtype.names if c.startswith(kind)]
        one, other = (np.array([table[c] for c in columns]) for table in (theirs, ours))
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max(), kind  # even harmonics are rounding
