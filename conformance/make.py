"""Make the sample files and the answers that belong to them.

    python conformance/make.py                 the small samples and all answers, in their places
    python conformance/make.py --large FOLDER  the large samples too, into a folder

The answers are computed in the modes of the reduced body one by one, with springs by Woodbury's identity, so that
`validate.py`, which solves the reduced matrices at every frequency, checks them by another way. On one thread and one
machine the same bytes come out at every run; another machine may differ in the last digits, which the tests allow.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import shutil
from pathlib import Path

import numpy as np
from bodies import LARGE, ROOT, SAMPLES

from microslip.basis import write_basis
from microslip.data import Array, ModalBasis, ModalGroup
from microslip.reduced.coordinates import compliance_row, in_modes

HERE = Path(__file__).resolve().parent
TOLERANCE = 1e-7
"""Relative to the largest value of an answer. The two ways agree to 4e-9 for the Craig-Bampton sample at a resonance of
D = 0.2 % (its stiffness has translations and rotations of whole patches side by side, so rounding counts), to 5e-13 for
the others."""

SAMPLE = "vane-eigenmodes"
"""What `microslip respond sample` and `microslip init sample` bring."""


def frequencies(g: ModalGroup) -> Array:
    """(12,) Hz: below, at and between the first elastic frequencies."""
    f = np.unique(g.frequency[g.omega > 0])[:3]
    between = np.linspace(0.3 * f[0], 1.2 * f[-1], 9)
    return np.round(np.sort(np.concatenate([between, f])), 6)


def response(g: ModalGroup, read: Array, load: Array, frequency: Array, springs: dict[str, list[float]]) -> Array:
    """(f,) complex answer by modal superposition; the springs as forces on the interface rows.

    Args:
        read, load: (m,) rows. springs: interface -> six stiffnesses to the ground.
    """
    own = in_modes(g)
    V = np.eye(g.n_modes) if g.to_diagonal is None else g.to_diagonal
    T = np.concatenate([[read], [load], *(g.interfaces[n].rows for n in springs)]) @ V
    k = np.concatenate([np.zeros(0), *(np.array(s) for s in springs.values())])
    N = 0.0 if own.N_r is None else own.N_r
    out = []
    for w in 2 * np.pi * frequency:
        Z = np.diag(own.omega**2 - w**2) + N + 1j * w * (own.C_r + own.G_r)
        H = T @ np.linalg.solve(Z, T.conj().T)
        free = H[0, 1]
        if len(k):
            free = free - H[0, 2:] @ np.linalg.solve(np.eye(len(k)) + k[:, None] * H[2:, 2:], k * H[2:, 1])
        out.append(free)
    return np.array(out)


def static(g: ModalGroup, read: str, load: str) -> complex:
    """Static answer of the reduced body, from what its coordinates hold (`Compliance.modal`)."""
    labels = list(g.compliance.labels)
    return complex(g.compliance.modal[labels.index(read), labels.index(load)])


def answers(basis: ModalBasis) -> list[dict[str, object]]:
    """Questions to every group of a basis, with their answers."""
    out: list[dict[str, object]] = []
    for (speed, harmonic), g in sorted(basis.groups.items()):
        where = {"speed": speed, "nodal_diameter": harmonic}
        labels = g.compliance.labels
        loads = [n for n in labels if n.startswith("excitation:")][:1]
        reads = [n for n in labels if n.startswith("monitor:")][:3]
        faces = [n for n, i in g.interfaces.items() if i.role != "load"]
        stiff = {n: [1e7, 2e6, 3e6, 100.0, 200.0, 300.0] for n in faces}
        if basis.name == "three-masses":
            stiff = {n: [0.0, 5e3, 0.0, 0.0, 0.0, 0.0] for n in faces}
        for read in reads:
            for springs in ({}, stiff) if stiff else ({},):
                f = frequencies(g)
                found = response(g, compliance_row(g, read), compliance_row(g, loads[0]), f, springs)
                asked = {"kind": "response", **where, "load": loads[0], "read": read}
                out.append(asked | _numbers(found, f) | ({"springs": springs} if springs else {}))
        rows = [f"interface:{n}:{row}" for n in faces for row in ("u_n", "u_t1", "phi_n")] + reads[:1]
        for load in (rows[0], loads[0]):
            for read in rows:
                value = np.array([static(g, read, load)])
                out.append({"kind": "static", **where, "load": load, "read": read} | _numbers(value))
    return out


def _numbers(values: Array, frequency: Array | None = None) -> dict[str, object]:
    told: dict[str, object] = {} if frequency is None else {"frequency_Hz": frequency.tolist()}
    return told | {"real": values.real.tolist(), "imag": values.imag.tolist()}


def write_answers(path: Path, basis: ModalBasis) -> None:
    """A JSON file with one answer a line."""
    lines = ",\n".join("  " + json.dumps(a) for a in answers(basis))
    head = {
        "sample": f"{path.stem}.h5",
        "units": "SI; per N of the load (per Pa of a pressure); time factor exp(+i omega t)",
        "tolerance": TOLERANCE,
    }
    text = "".join(f" {json.dumps(k)}: {json.dumps(v)},\n" for k, v in head.items())
    path.write_text("{\n" + text + ' "answers": [\n' + lines + "\n ]\n}\n", encoding="utf-8")


def make(samples: Path, told: Path, large: Path | None = None) -> None:
    """Write samples and answers into their folders."""
    for folder in (samples, told):
        folder.mkdir(parents=True, exist_ok=True)
    for name, build in SAMPLES.items():
        if name in LARGE and large is None:
            continue
        basis = build()
        folder = large if name in LARGE and large else samples
        write_basis(folder / f"{name}.h5", basis)
        write_answers((large if name in LARGE and large else told) / f"{name}.json", basis)
        print(folder / f"{name}.h5", (folder / f"{name}.h5").stat().st_size)


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the samples of the conformance kit.")
    parser.add_argument("--large", type=Path, help="folder for the large samples and their answers")
    given = parser.parse_args()
    if given.large:
        given.large.mkdir(parents=True, exist_ok=True)
    make(HERE / "samples", HERE / "answers", given.large)
    shutil.copyfile(HERE / "samples" / f"{SAMPLE}.h5", ROOT / "pipeline/microslip/samples/basis.h5")


if __name__ == "__main__":
    main()
