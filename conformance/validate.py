#!/usr/bin/env python3
"""Validate a modal file with h5py and NumPy alone, and the answers another program got from it.

    python validate.py FILE.h5                      format, schema, and what the numbers must satisfy among themselves
    python validate.py FILE.h5 --answers FILE.json  besides, the linear answers of the reduced body, recomputed here

Exit code 0: everything holds; 1: findings, one a line; 2: no modal file, or one that may not be opened.
The file is first opened in a process of its own with bounded memory and time, because damaged HDF5 can hang or crash
the library. Nothing in it is executed; links to other files are refused. The layout is read from schema.json beside.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from functools import cache
from itertools import product
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
SEAL = b"\nmicroslip seal, sha256 of all bytes before this line: "
INTERFACE_ROWS = ["u_n", "u_t1", "u_t2", "phi_n", "phi_t1", "phi_t2"]


class Refused(Exception):
    """The file cannot be validated at all."""


# what may not be opened -------------------------------------------------------------------------------------------


def sealed(path):
    """A finding if the file's own seal is there and broken."""
    data = path.read_bytes()
    end = len(data) - len(SEAL) - 65
    if end < 0 or data[end : end + len(SEAL)] != SEAL:
        return []
    told = data[end + len(SEAL) : -1].decode("ascii", "replace")
    same = hashlib.sha256(data[:end]).hexdigest() == told
    return [] if same else ["seal: the bytes are not those the file was sealed with; it is damaged or was changed"]


def inspect(file, size):
    """Every object, before any data is read: no links out, no other types, no more data than the file can hold."""
    budget, seen = [64 * max(size, 1 << 14), 200_000], []

    def look(group, where, above):
        here = h5py.h5o.get_info(group.id).addr
        if here in above or len(above) > 12:
            raise Refused(f"{where or '/'} contains itself or is nested too deeply")
        for name in group:
            place = f"{where}/{name}"
            budget[1] -= 1
            if budget[1] < 0:
                raise Refused("there are too many objects")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise Refused(f"{place} is a link to another place")
            item = group[name]
            seen.append(place)
            if isinstance(item, h5py.Group):
                look(item, place, (*above, here))
            elif not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiuS" or item.dtype.subdtype:
                raise Refused(f"{place} holds neither numbers nor fixed-length text")
            elif item.shape is None or item.is_virtual or item.external:
                raise Refused(f"{place} holds no data of its own")
            else:
                budget[0] -= int(np.prod(item.shape, dtype=object)) * item.dtype.itemsize
                if budget[0] < 0:
                    raise Refused(f"{place} claims more data than the file can hold")

    look(file, "", ())
    return seen


# the schema -------------------------------------------------------------------------------------------------------


class Schema:
    """schema.json, compiled: which entry a path belongs to, and the words in <> it stands for."""

    def __init__(self, path=HERE / "schema.json"):
        self.table = json.loads(path.read_text(encoding="utf-8"))
        self.entries = {e["path"]: e for e in self.table["entries"]}
        self.patterns = [(self._pattern(p), e) for p, e in self.entries.items()]
        self.find = cache(self._find)

    @staticmethod
    def _pattern(path):
        text = re.sub(r"<(\w+)>", r"@@\1@@", path)
        text = re.escape(text)
        text = re.sub(r"@@(\w+)@@", r"(?P<\1>[^/]+)", text)
        if text.startswith("S"):
            text = r"(?P<S>/speed_\d+/nd_\d+|/range/nd_\d+/sample_\d+)" + text[1:]
        return re.compile(text.replace(r"_(?P<i>[^/]+)", r"_(?P<i>\d+)").replace(r"_(?P<k>[^/]+)", r"_(?P<k>\d+)"))

    def _find(self, path, attribute=False):
        """Entry and words of a path (an attribute is path@name); literal names win."""
        of_kind = ((p, e) for p, e in self.patterns if attribute == (e["kind"] == "attribute"))
        found = [(m.groupdict(), e) for p, e in of_kind if (m := p.fullmatch(path))]
        return min(found, key=lambda f: f[1]["path"].count("<"), default=({}, None))


known_schema = cache(Schema)


def check_schema(file, places, schema):
    """Findings about names, types, units, labels, sizes and missing parts."""
    found, sizes, children = [], {}, {}
    for place in ["/", *places]:
        item = file[place]
        if place != "/":
            imaginary = _is_imaginary(file, place)
            words, entry = schema.find(place[:-5] if imaginary else place)
            if entry is None:
                found.append(f"{place}: is no part of the format")
                continue
            children.setdefault(place.rsplit("/", 1)[0] or "/", set()).add(entry["path"])
            found += _object(place, item, entry, words, schema, sizes, imaginary)
        for name in item.attrs:
            if name in ("CLASS", "NAME", "DIMENSION_LIST", "DIMENSION_LABELS", "REFERENCE_LIST", "unit") and (
                name != "unit" or isinstance(item, h5py.Dataset)
            ):
                continue
            path = f"{place}@{name}"
            _, entry = schema.find(path, attribute=True)
            if entry is None:
                found.append(f"{path}: is no part of the format")
            else:
                children.setdefault(place, set()).add(entry["path"])
                found += _attribute(path, item.attrs[name], entry)
    return found + _missing(["/", *places], children, schema)


def _is_imaginary(file, place):
    return place.endswith("_imag") and place[:-5] in file


def _missing(places, children, schema):
    found = []
    required = {}
    for path, entry in schema.entries.items():
        if entry["required"]:
            parent = path.rsplit("@", 1)[0] if "@" in path else path.rsplit("/", 1)[0] if "/" in path[1:] else "/"
            required.setdefault("/" if path.startswith("/") and parent == "" else parent, []).append(path)
    for place in places:
        _, entry = ({}, {"path": "/"}) if place == "/" else schema.find(place)
        for path in required.get(entry["path"], []) if entry else []:
            if path != "S" and path not in children.get(place, set()):
                found.append(f"{place}: lacks {path.replace(entry['path'], '', 1).lstrip('/')}")
    groups = [p for p in places if re.fullmatch(r"/speed_\d+/nd_\d+", p)]
    return found if groups else [*found, "/: has no group speed_0/nd_0"]


def _object(place, item, entry, words, schema, sizes, imaginary):
    if entry["kind"] == "group":
        return [] if isinstance(item, h5py.Group) else [f"{place}: must be a group"]
    if not isinstance(item, h5py.Dataset):
        return [f"{place}: must be a dataset"]
    found = []
    kind = {"float": "f8", "integer": "i8"}.get(entry["type"], "S")
    if entry["type"] == "text":
        if item.dtype.kind != "S":
            found.append(f"{place}: must hold fixed-length text, has {item.dtype}")
    elif item.dtype.str[1:] not in (kind, "f4" if entry.get("single") else kind):
        found.append(f"{place}: must hold 64-bit {entry['type']} numbers, has {item.dtype}")
    if imaginary and not entry.get("complex"):
        found.append(f"{place}: nothing there may be complex")
    unit, wanted = item.attrs.get("unit", ""), entry.get("unit", "")
    wanted = item.parent.attrs.get("unit", "") if wanted == "@unit" else wanted
    if unit != wanted:
        found.append(f"{place}: its unit is '{unit}', must be '{wanted}'")
    if "content" in entry and item.shape == (len(entry["content"]),):
        told = [v.decode("utf-8", "replace") for v in item[()]]
        if told != entry["content"]:
            found.append(f"{place}: says {' '.join(told)}, must say {' '.join(entry['content'])}")
    return found + _shape(place, item, entry, words, schema.table, sizes)


def _shape(place, item, entry, words, table, sizes):
    shape = entry["shape"]
    if len(item.shape) != len(shape):
        return [f"{place}: has {len(item.shape)} axes, must have {len(shape)}: {' x '.join(shape)}"]
    found = []
    for axis, (size, name) in enumerate(zip(item.shape, shape, strict=True)):
        label = item.dims[axis].label
        if not entry.get("scale") and label not in table["labels"].get(name, [name]):
            found.append(f"{place}: axis {axis + 1} is called '{label}', must be '{name}'; is it transposed?")
        fixed = table["fixed_sizes"].get(name)
        if fixed is None and name.endswith("_corner") and name != "patch_corner":
            fixed = table["corners"].get(place.rsplit("/", 1)[-1])
        if fixed is None:
            base = table["equal_sizes"].get(name, name)
            key = (base, *(words.get(w) for w in table["scope"].get(base, [])))
            first, fixed = sizes.setdefault(key, (place, size))
            if fixed != size:
                found.append(f"{place}: axis {axis + 1} ({name}) has {size} entries, but {first} has {fixed}")
        elif size != fixed:
            found.append(f"{place}: axis {axis + 1} ({name}) has {size} entries, must have {fixed}")
    return found


def _attribute(path, value, entry):
    kinds = {"text": (str, bytes), "integer": (int, np.integer), "float": (float, np.floating)}[entry["type"]]
    if "shape" in entry:
        good = isinstance(value, np.ndarray) and value.shape == (3,) and value.dtype.kind == "f"
    else:
        good = isinstance(value, kinds)
    if not good:
        return [f"{path}: must be {entry['type']}"]
    if "choices" in entry and value not in entry["choices"]:
        return [f"{path}: is {value!r}, must be one of {', '.join(map(repr, entry['choices']))}"]
    return []


# the numbers ------------------------------------------------------------------------------------------------------


def get(group, name):
    """A dataset, its imaginary part added."""
    real = group[name][()]
    return real + 1j * group[name + "_imag"][()] if name + "_imag" in group else real


def text(group, name):
    return [v.decode("utf-8", "replace") for v in group[name][()]]


def largest(a):
    return np.float64(np.abs(a).max(initial=0.0))  # squares of absurd numbers become infinite, not exceptions


def check_numbers(file):
    """Findings: (place, what, size of the error, limit)."""
    findings = []

    def claim(place, what, error, limit):
        if not error <= limit:  # NaN too
            findings.append(f"{place}: {what}: off by {error:.3g} (limit {limit:.3g})")

    def finite(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and not re.search(r"gyroscopic/error$", name):
            claim("/" + name, "every number is finite", float((~np.isfinite(item[()])).sum()), 0)

    file.visititems(finite)
    if findings:
        return findings
    source = file.attrs["source"]
    ids = file["mesh/node"][()]
    claim("/mesh/node", "numbers every node once", float(len(ids) - len(np.unique(ids))), 0)
    claim("/node", "is /mesh/node", largest(file["node"][()] - ids), 0)
    for name in file["mesh/cells"]:
        cells = file[f"mesh/cells/{name}"][()]
        outside = float((cells < 0).sum() + (cells >= len(ids)).sum())
        claim(f"/mesh/cells/{name}", "refers to nodes that are there", outside, 0)
    for name in file["interfaces"]:
        frame = file[f"interfaces/{name}"]
        R, n = frame["rotation"][()], frame["patch/normals"][()]
        error = largest(R @ R.T - np.eye(3)) + abs(np.linalg.det(R) - 1)
        claim(f"/interfaces/{name}/rotation", "is right-handed and orthonormal", error, 1e-9)
        claim(f"/interfaces/{name}/patch/normals", "have unit length", largest(np.linalg.norm(n, axis=1) - 1), 1e-9)
    if findings:
        return findings
    groups = [f"{s}/{k}" for s in file if s.startswith("speed_") for k in file[s] if k.startswith("nd_")]
    for s in groups:
        omega = file[s.split("/")[0]].attrs["Omega"]
        check_group(file, file[s], float(omega), source, claim)
    return findings


def check_group(file, g, speed, source, claim):
    place, modes = g.name, g["modes"]
    omega, M, K, C, G = (get(modes, n) for n in ("omega", "M_r", "K_r", "C_r", "G_r"))
    kind = text(modes, "kind")
    V = get(modes, "to_diagonal") if "to_diagonal" in modes else np.eye(len(kind))
    H, top = V.conj().T, max(largest(omega) ** 2, 1.0)
    hertz, damping = modes["frequency"][()], modes["damping_ratio"][()]
    claim(f"{place}/modes/frequency", "is omega / 2 pi", largest(hertz * 2 * np.pi - omega), 1e-12 * np.sqrt(top))
    claim(f"{place}/modes/omega", "ascends", float((-np.diff(omega)).max(initial=0.0)), 1e-9 * np.sqrt(top))
    claim(f"{place}/modes/M_r", "V^H M_r V is the identity", largest(H @ M @ V - np.eye(len(omega))), 1e-9)
    rest = H @ K @ V - np.diag(omega**2)
    if speed:  # of a free body that turns the rows and columns of its rigid motions hold what rotation does to them
        rest = rest[np.ix_(omega > 0, omega > 0)]
    claim(f"{place}/modes/K_r", "V^H K_r V is diag(omega^2)", largest(rest) / top, 1e-9)
    for name, A in (("M_r", M), ("K_r", K), ("C_r", C)):
        claim(f"{place}/modes/{name}", "is Hermitian", largest(A - A.conj().T), 1e-9 * max(largest(A), 1e-300))
    claim(f"{place}/modes/G_r", "is skew", largest(G + G.conj().T), 1e-9 * max(largest(G), 1e-12))
    D = np.diag(H @ C @ V).real / 2
    claim(f"{place}/modes/damping_ratio", "C_r holds 2 D omega", largest(D - damping * omega), 1e-9 * np.sqrt(top))
    rigid = [w for w, c in zip(omega, kind, strict=True) if c == "rigid"] if "to_diagonal" not in modes else []
    claim(f"{place}/modes/omega", "rigid motions have omega = 0", largest(np.array(rigid)), 0.0)
    if "phi" in modes and source == "elements":
        check_shapes(file, get(modes, "phi"), M, V, claim, place)
    for name in g["interfaces"]:
        check_rows(file[f"interfaces/{name}"], g[f"interfaces/{name}"], claim)
    check_compliance(g, kind, K, V, omega, claim)
    if "run_up" in g:
        N = get(g["run_up"], "N")
        limit = 1e-9 * max(2 * abs(speed) * largest(N), 1e-12)
        claim(f"{place}/run_up/N", "G_r is 2 Omega N", largest(G - 2 * speed * N), limit)
    if "gyroscopic" in g:
        y = g["gyroscopic"]
        s, x = y["growth"][()] + 1j * y["omega"][()], get(y, "shapes")
        rest = s**2 * (M @ x) + s * (G @ x) + K @ x
        scale = (largest(K) + largest(G) * largest(s) + largest(s) ** 2 * largest(M)) * max(largest(x), 1.0)
        claim(f"{place}/gyroscopic", "its modes satisfy their equation", largest(rest) / scale, 1e-8)


def check_rows(frame, own, claim):
    """The six rows against the motion of the patch: its area-weighted best rigid motion, in the patch's frame."""
    if "patch" not in own:
        return
    R, areas, r = frame["rotation"][()], frame["patch/areas"][()], frame["patch/points"][()] - frame["origin"][()]
    u, T = get(own["patch"], "shapes"), get(own, "T")
    top = max(largest(T[:3]), 1e-300)
    mean = R @ np.einsum("p,pim->im", areas, u) / areas.sum()
    claim(f"{own.name}/T", "translations are the patch's mean motion", largest(mean - T[:3]) / top, 1e-9)
    second = np.einsum("p,pi,pj->ij", areas, r, r)
    J = np.trace(second) * np.eye(3) - second
    size = np.sqrt(largest(J) / areas.sum())
    if len(areas) > 2 and np.linalg.eigvalsh(J)[0] > 1e-6 * largest(J):
        moment = np.einsum("p,pim->im", areas, np.cross(r[:, :, None], u, axisa=1, axisb=1, axisc=1))
        turn = R @ np.linalg.solve(J, moment)
        claim(f"{own.name}/T", "rotations are the patch's best fit", largest(turn - T[3:]) * size / top, 1e-8)


def compliance_rows(g):
    """(r, m) the rows that the labels of the compliance name, or None."""
    out = []
    for label in text(g, "compliance_row"):
        kind, name, row = label.split(":", 2)
        link = name.replace("%", "%25").replace("/", "%2F")
        if kind == "interface":
            item = g["interfaces"][link]
            six = row in INTERFACE_ROWS
            rows = get(item, "T") if six else get(item, "characteristic")
            out.append(rows[INTERFACE_ROWS.index(row) if six else int(row[1:]) - 1])
        else:
            item = g[kind][link]
            out.append(get(item, "T")[text(item, "row").index(row)])
    return np.array(out)


def check_compliance(g, kind, K, V, omega, claim):
    static, modal = get(g, "compliance_static"), get(g, "compliance_modal")
    if not len(static):
        return
    place = f"{g.name}/compliance"
    claim(f"{place}_static", "is Hermitian", largest(static - static.conj().T), 1e-9 * largest(static))
    d = np.sqrt(np.maximum(np.diag(static).real, 1e-300))
    below = -float(np.linalg.eigvalsh((static - modal) / np.outer(d, d))[0])
    claim(f"{place}_static", "is not below the part the coordinates hold", below, 1e-6)
    if not set(kind) & {"massless-interface", "interface-force"}:
        T = compliance_rows(g) @ V
        elastic = omega > 0
        held = (T[:, elastic] / omega[elastic] ** 2) @ T[:, elastic].conj().T
        claim(f"{place}_modal", "follows from the rows", largest(held - modal) / max(largest(held), 1e-300), 1e-9)


def check_shapes(file, phi, M, V, claim, place):
    """phi^H (integral of rho N^T N) phi against M_r: shapes in another order of the nodes fail here."""
    materials = file["mesh/materials"] if "materials" in file["mesh"] else None
    inner, mass, first, second = np.zeros_like(M), 0.0, np.zeros(3), np.zeros((3, 3))
    for name, item in file["mesh/cells"].items():
        if name not in RULES:
            return  # a cell type this script does not integrate
        rho = 1.0 if materials is None else materials["density"][()][materials[f"cells/{name}"][()]][:, None]
        N, dN, weights = RULES[name]
        cells, x = item[()], file["mesh/xyz"][()]
        J = np.einsum("qkd,eki->eqdi", dN, x[cells])
        dm = rho * np.linalg.det(J) * weights
        claim(item.name, "cells have positive volume", float((dm <= 0).sum()), 0)
        u = np.einsum("qk,ekim->eqim", N, phi[cells])
        inner = inner + np.einsum("eqil,eq,eqim->lm", u.conj(), dm, u)
        at = np.einsum("qk,eki->eqi", N, x[cells])
        mass += float(dm.sum())
        first += np.einsum("eq,eqi->i", dm, at)
        second += np.einsum("eq,eqi,eqj->ij", dm, at, at)
    total = np.float64(file["body/mass"][()])
    density = total / mass if materials is None else 1.0
    if materials is not None:
        claim("/body/mass", "is that of the mesh and its materials", abs(mass / total - 1), 1e-8)
    centre, size = first / mass, np.ptp(file["mesh/xyz"][()], axis=0).max(initial=0.0)
    about = density * second - total * np.outer(centre, centre)
    claim("/body/centre", "is the mesh's", largest(file["body/centre"][()] - centre) / size, 1e-8)
    inertia = np.trace(about) * np.eye(3) - about
    error = largest(file["body/inertia"][()] - inertia) / (total * size**2)
    claim("/body/inertia", "is the mesh's (is it in metres?)", error, 1e-8)
    inner = inner * density
    error = largest(V.conj().T @ (inner - M) @ V)
    claim(f"{place}/modes/phi", "phi^H M phi is M_r on the mesh (is the order of the nodes the mesh's?)", error, 1e-8)


def _rules():
    """Cell type -> shape functions (q, k), their slopes (q, k, 3), weights (q,) at the format's points."""
    edges = {4: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}
    edges[8] = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    sides = [(3, 0, 4, 7), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 2, 1), (4, 5, 6, 7)]
    tet = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    cube = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    middle = {len(c): np.array([c[list(e)].mean(axis=0) for e in edges[len(c)]]) for c in (tet, cube)}
    full = np.vstack([cube, middle[8], [cube[list(s)].mean(axis=0) for s in sides], [[0.5, 0.5, 0.5]]])
    powers = list(product(range(3), repeat=3))
    kinds = {
        "tetra": (tet, [p for p in powers if sum(p) <= 1]),
        "tetra10": (np.vstack([tet, middle[4]]), [p for p in powers if sum(p) <= 2]),
        "hexahedron": (cube, [p for p in powers if max(p) <= 1]),
        "hexahedron20": (np.vstack([cube, middle[8]]), [p for p in powers if p.count(2) <= 1]),
        "hexahedron27": (full, powers),
    }
    return {name: _rule(name, np.array(nodes), exponents) for name, (nodes, exponents) in kinds.items()}


def _rule(name, nodes, exponents):
    if name.startswith("tetra"):
        a, b = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
        at, weights = (np.full((4, 4), a) + (b - a) * np.eye(4))[:, 1:], np.full(4, 1 / 24)
    else:
        x, w = np.polynomial.legendre.leggauss(2 if name == "hexahedron" else 3)
        at = np.array(list(product((x + 1) / 2, repeat=3)))
        weights = np.array([np.prod(c) for c in product(w / 2, repeat=3)])

    def monomials(points, slope=None):
        out = []
        for e in exponents:
            factors = [
                e[d] * points[:, d] ** max(e[d] - 1, 0) if d == slope else points[:, d] ** e[d] for d in range(3)
            ]
            out.append(np.prod(factors, axis=0))
        return np.stack(out, axis=1)

    inverse = np.linalg.inv(monomials(nodes))
    return monomials(at) @ inverse, np.stack([monomials(at, d) @ inverse for d in range(3)], axis=2), weights


RULES = _rules()


# linear answers ---------------------------------------------------------------------------------------------------


def row_of(g, name):
    """A row by its label: interface:right:u_n, excitation:magnet:force, monitor:probe:u_x."""
    kind, item, row = name.split(":")
    if kind == "interface":
        return get(g["interfaces"][item], "T")[INTERFACE_ROWS.index(row)]
    where = g[kind][item]
    return get(where, "T")[text(where, "row").index(row)]


def answer(file, asked):
    """What the reduced body answers, straight from M_r, C_r, G_r, K_r, N_r and the rows. A static answer of a free body
    is its elastic part, and knows nothing of N_r, as the compliances do.

    Response: read @ (K + N - w^2 M + i w (C + G))^-1 load^H for a unit amplitude, with springs (N/m, N m/rad) from the
    six rows of the interfaces in `springs` to the ground.
    """
    g = file[f"speed_{asked['speed']}/nd_{asked['nodal_diameter']}"]
    M, K, C, G = (get(g["modes"], n) for n in ("M_r", "K_r", "C_r", "G_r"))
    for name, stiffness in asked.get("springs", {}).items():
        T = get(g["interfaces"][name], "T")
        K = K + T.conj().T @ (np.array(stiffness)[:, None] * T)
    load, read = row_of(g, asked["load"]).conj(), row_of(g, asked["read"])
    if asked["kind"] == "static":
        return np.array([read @ np.linalg.solve(K, load)])
    K = K + get(g["modes"], "N_r") if "N_r" in g["modes"] else K
    w = 2 * np.pi * np.array(asked["frequency_Hz"])
    return np.array([read @ np.linalg.solve(K - v**2 * M + 1j * v * (C + G), load) for v in w])


def check_answers(file, path):
    """Findings about the answers in a JSON file."""
    try:
        table = json.loads(Path(path).read_text(encoding="utf-8"))
        answers = table["answers"]
        found = []
        for number, asked in enumerate(answers):
            told = np.array(asked["real"]) + 1j * np.array(asked["imag"])
            right = answer(file, asked)
            error = largest(told - right) / max(largest(right), 1e-300) if told.shape == right.shape else np.inf
            if not error <= table["tolerance"]:
                what = f"{asked['kind']} of {asked['read']} to {asked['load']}"
                found.append(f"answer {number + 1} ({what}): off by {error:.3g} (limit {table['tolerance']:.3g})")
        return found
    except (KeyError, ValueError, TypeError, OSError, IndexError) as error:
        raise Refused(f"{path}: no list of answers ({type(error).__name__}: {error})") from error


# the command ------------------------------------------------------------------------------------------------------

DAMAGE = (
    OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, IndexError, ArithmeticError, MemoryError,
    NotImplementedError, RecursionError, UnicodeError, np.linalg.LinAlgError,
)  # fmt: skip
"""What h5py and NumPy raise on content that is not what it should be."""


def validate(path, answers=None):
    """Findings, one text each.

    Raises:
        Refused: see the head of this file.
    """
    path = Path(path)
    try:
        found = sealed(path)
        with h5py.File(path, "r") as file:
            places = inspect(file, path.stat().st_size)
            if file.attrs.get("format") != "microslip-modal-basis":
                raise Refused("its attribute 'format' does not say microslip-modal-basis")
            found += check_schema(file, places, known_schema())
            with np.errstate(all="ignore"):  # absurd numbers are findings, not warnings
                if not found:
                    found += check_numbers(file)
                if not found and answers:
                    found += check_answers(file, answers)
        return found
    except DAMAGE as error:
        raise Refused(f"cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:120]})") from error


def inside(path, answers):
    """The work, in the bounded process."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    except (ImportError, ValueError, OSError):
        pass  # not everywhere
    try:
        found = validate(path, answers)
    except Refused as error:
        print(f"{path}: refused: {error}")
        return 2
    for line in found:
        print(f"{path}: {line}")
    if not found:
        print(f"{path}: conforms" + (" and its answers agree" if answers else ""))
    return 1 if found else 0


def main(words=None):
    parser = argparse.ArgumentParser(description="Validate a modal file.")
    parser.add_argument("file", type=Path)
    parser.add_argument("--answers", type=Path, help="JSON with linear answers to compare")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.inside:
        return inside(given.file, given.answers)
    if not given.file.is_file():
        print(f"{given.file}: refused: there is no such file")
        return 2
    more = ["--answers", str(given.answers)] if given.answers else []
    limit = 60 + given.file.stat().st_size / 1e6
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        command = [sys.executable, __file__, "--inside", str(given.file), *more]
        done = subprocess.run(command, env=environment, timeout=limit, capture_output=True, text=True)
    except subprocess.TimeoutExpired:
        print(f"{given.file}: refused: HDF5 does not come to an end on it")
        return 2
    if done.returncode not in (0, 1, 2) or (done.returncode == 1 and not done.stdout):
        print(f"{given.file}: refused: HDF5 crashes on it")
        return 2
    print(done.stdout, end="")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
