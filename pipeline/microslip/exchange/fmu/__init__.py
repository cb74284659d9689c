"""FMU: a reduced body for system simulators, FMI 2.0, model exchange and co-simulation in one file.

States are the modal coordinates and their rates, inputs the forces on the rows of interfaces and excitations, outputs
what interfaces, monitors and gauges read, and its rate. The equations stand in ``body.c``; a unit holds that source,
the numbers of the body and the binary that the C compiler of this machine makes of both.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from math import pi
from pathlib import Path

from ...data import ModalBasis, ModalGroup
from ...errors import UserError
from ...files.store import complete_or_absent
from ...reduced.coordinates import in_modes
from ...units import rpm_text
from ..choice import STATEMENT, Format, only_group, real, whole_body, whole_in_modes
from ..mat import field_names
from .description import description, output_step
from .unit import numbers, unit_of

_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
_SYSTEMS = {"Darwin": ("darwin64", ".dylib"), "Windows": ("win64", ".dll")}


def write_fmu(basis: ModalBasis, path: Path | str) -> None:
    """Write one group, complete or absent. Same basis, same compiler, same bytes.

    Raises:
        UserError: several groups, a cyclic sector, flexibility outside the modes, nothing to act on or to read, no C
            compiler, no permission, no space.
    """
    g = only_group(basis, "fmu")
    whole_body(basis, "fmu")
    unit = unit_of(basis, whole_in_modes(basis, real(g, "fmu"), "fmu"))
    name = field_names([basis.name])[0]
    source = Path(__file__).with_name("body.c").read_bytes()
    table = ("\n".join(numbers(unit)) + "\n").encode("ascii")
    guid = hashlib.sha256(source + table).hexdigest()[:32]
    files = {"body.c": source, "numbers.h": f'#define GUID "{guid}"\n'.encode() + table}
    place, ending = _SYSTEMS.get(platform.system(), ("linux64", ".so"))
    binary = compiled(files, ending)
    inside = {"modelDescription.xml": description(unit, name, guid, _said(basis, g))}
    inside |= {f"sources/{n}": data for n, data in files.items()} | {f"binaries/{place}/{name}{ending}": binary}
    with complete_or_absent(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for at, data in inside.items():
            archive.writestr(zipfile.ZipInfo(at), data, zipfile.ZIP_DEFLATED)  # dated 1980


def _said(basis: ModalBasis, g: ModalGroup) -> str:
    return (
        f"{basis.name} at {rpm_text(g.speed)}, by microslip: vibration about the static state. {STATEMENT}. Interfaces "
        "in their own frame (n outwards, t1, t2); modal mass 1."
    )


def compiled(files: Mapping[str, bytes], ending: str) -> bytes:
    """The shared library of ``body.c``, by the compiler that CC names, else cc.

    Raises:
        UserError: there is none, or it fails, or there is no folder for temporary files.
    """
    try:
        compiler = shlex.split(os.environ.get("CC", "")) or ["cc"]
        return _built(compiler, files, ending)
    except (OSError, ValueError) as error:
        raise UserError(
            f"export --to fmu: the C compiler cannot be run ({error}); see to CC, which names it, and to TMPDIR, the "
            "folder of temporary files"
        ) from error


def _built(compiler: list[str], files: Mapping[str, bytes], ending: str) -> bytes:
    if shutil.which(compiler[0]) is None:
        raise UserError(
            f"export --to fmu: there is no C compiler {compiler[0]}, which makes the binary; install gcc, or name "
            "another one in CC"
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            Path(folder, name).write_bytes(data)
        command = [
            *compiler,
            *_OPTIONS,
            "-o",
            f"body{ending}",
            "body.c",
            "-lm",
        ]  # no path of this machine in the binary
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
        if done.returncode or not Path(folder, f"body{ending}").is_file():
            said = " ".join(done.stderr.split())[:200] or f"exit code {done.returncode}"
            raise UserError(f"export --to fmu: the C compiler {compiler[0]} fails ({said}); name another one in CC")
        return Path(folder, f"body{ending}").read_bytes()


PERIODS = 20
"""Of the highest mode between two outputs, that CVode follows in the 500 steps that simulators let it take: 24 a period
with their usual tolerance of 1e-5 (FMPy 0.3)."""


def warnings(basis: ModalBasis) -> list[str]:
    """Of one group: modes that are too fast to be integrated between the outputs of the default experiment."""
    unit = unit_of(basis, in_modes(only_group(basis, "fmu")))
    highest = unit.omega.max() / (2 * pi)
    if output_step(unit) * highest <= PERIODS:
        return []
    return [f"{basis.name}: the highest mode has {1e-3 * highest:.4g} kHz; in model exchange simulators stop at "
            f"CVode's 500 steps unless outputs are {PERIODS / highest:.2g} s apart or less; keep fewer modes, or take "
            "co-simulation, which is exact"]  # fmt: skip


FORMATS = (Format("fmu", ".fmu", "system simulators: FMI 2.0", write_fmu, warnings),)
