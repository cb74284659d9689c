"""From a description of a body or of an assembly, in a file or as a dict of the same keys, to what can be analysed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from . import sliding
from .analyses import whole_of
from .basis import read_basis
from .case.assemble import Built, build
from .case.contacts import swept
from .case.settings import UNPRESSED, case_model, unasked_sweep
from .data import ModalBasis
from .errors import UserError
from .progress import Report
from .settings.arguments import Index, Text, Vector, checked
from .settings.mistakes import unfit, validate
from .settings.numbers import NotNegative, Number, Positive
from .settings.toml import load_toml
from .stages.job import job_of, open_job, system_file
from .stages.places import modal_files
from .system.assembly import Assembly

if TYPE_CHECKING:
    from .roots.diagram import Diagram
    from .roots.spectrum import Spectrum


def _from_to(value: Any) -> Any:
    if not isinstance(value, list | tuple | np.ndarray) or len(value) != 2:
        raise ValueError("must be two numbers, from and to")
    if said := unfit([v for v in value if not isinstance(v, float) or not math.isinf(v)]):
        raise ValueError(said)
    if not value[0] < value[1]:
        raise ValueError(f"{value[0]:g} to {value[1]:g} has no area; give the smaller number first")
    return value


Window = Annotated[Any, BeforeValidator(_from_to)]


@checked
def modes(
    body: Path | str | Mapping[str, Any], folder: Path | str = ".", report: Report = lambda _: None
) -> ModalBasis:
    """The modal basis of a body: from its mesh, or from its drawing by way of one.

    Args:
        body: a body.toml or its folder, made where it is not up to date, as ``microslip modes`` does (``meshes/`` and
            ``build/`` in the folder); a system.toml of masses, rigid bodies or matrices, likewise; or the keys of a
            body.toml (``docs/body_toml.md``) as a dict with ``geometry.mesh``, of which nothing is written.
        folder: where paths and products begin. report: is told what is under way.

    Raises:
        UserError: a mistake in the settings or the mesh, with the key or the place.
        NotConverged: the equilibrium at speed or the spectrum was not found.

    Examples:
        >>> import microslip as ms
        >>> basis = ms.modes({
        ...     "name": "plate", "length_unit": "m", "geometry": {"mesh": "meshes/tiny/plate.msh"},
        ...     "material": {"name": "steel", "density": 7850.0, "young": 2.1e11, "poisson": 0.3},
        ...     "support": [{"face": "root"}],
        ... })  # doctest: +SKIP
    """
    from .stages import modal

    if isinstance(body, Mapping):
        job = job_of(dict(body), Path(folder))
        if job.settings.geometry.mesh is None:
            raise UserError("geometry.mesh: is missing: a body given as a dict has a mesh; or write a body.toml")
        return modal.basis_of(job, job.mesh_file, report)[0]
    if (system := system_file(Path(body))) is not None:
        return read_basis(modal.system_stage(system, report=report, root=Path(folder)))
    return read_basis(modal.modes_stage(open_job(body, root=folder), report=report)[0])


@checked
def stability(
    body: Any, *, frequency: Window | None = None, growth: Window = (-math.inf, math.inf),
    over: Text | None = None, values: Vector | None = None, at: Mapping[str, Number] | None = None,
    accuracy: Positive = 1e-8, neutral: NotNegative = 0.0, certify: bool = True, speed: Index | None = None,
    report: Report = lambda _: None,
) -> Spectrum | Diagram:  # fmt: skip
    """Roots s of (s^2 M + s C + K) x = 0 in a window, none missed: what grows by itself, and how fast.

    Args:
        body: a body.toml of matrices or its folder, a modal file or basis, matrices (M, C, K),
            none of which need be symmetric, sparse or not, a `linalg.parametric.Family`; or an assembly, about its
            steady sliding.
        frequency: Hz, from, to; of a body.toml, what its [stability] says if not given. growth: 1/s, from, to. Both may
            be left out where there are no more than 300 coordinates.
        over: parameter that matrices scale with, and values: of it, rising; then the roots at each of them come from
            one basis. at: values of the other parameters.
        accuracy: relative, of the matrices' entries. neutral: 1/s, growth rates below it are not decided.
        certify: count the roots by the argument principle too. speed: which of a modal file's or basis's, from 0, where
            there are several.

    Raises:
        UserError: several speeds and none chosen, matrices of different sizes or with numbers that are not finite, a
            window without area, an unknown parameter, a value at which a matrix is not defined; an assembly whose
            contacts wait for a normal force or cannot be linearised. NotConverged: no steady sliding is found.

    Examples:
        A double pendulum under a follower force flutters:

        >>> import microslip as ms
        >>> found = ms.stability(([[3, 1], [1, 1]], [[0, 0], [0, 0]], [[2 - 3, 3 - 1], [-1, 1]]))
        >>> found.verdict
        ('stable', 'unstable')
    """
    from .roots.asked import roots_of
    from .stages.stability import question

    if isinstance(body, str | Path):
        q = question(Path(body), [], report, speed)
        if q.speeds > 1 and speed is None:
            raise UserError(f"stability: {q.where} holds {q.speeds} speeds; give speed = 0 to {q.speeds - 1}")
        window = (q.asked.growth, q.asked.frequency)
        growth = window[0] if math.isinf(growth[0]) and math.isinf(growth[1]) else growth
        neutral, body, at = neutral or q.asked.neutral, q.family(), {**q.at, **(at or {})}
        frequency, speed = frequency or window[1], None
    if isinstance(body, Assembly | Built):
        equations = sliding.of(whole_of(body))
        C, K = sliding.linearised(equations, sliding.equilibrium(equations))
        body = np.eye(len(K)), C, K
    return roots_of(body, frequency, growth, over, values, at, accuracy, neutral, certify, speed, report)


@checked
def assemble(
    case: Path | str | Mapping[str, Any], folder: Path | str = ".", *, normal_force: NotNegative | None = None,
    report: Report = lambda _: None, **bases: ModalBasis | Path | str,
) -> Built:  # fmt: skip
    """An assembly of bodies with contacts, loads and read-outs.

    Args:
        case: a case.toml, or its keys (``docs/case_toml.md``) as a dict; this needs no ``sweep``.
        folder: where paths begin. normal_force: N, of every contact that has none of its own.
        bases: body -> its modal basis or file; those of a file that are not named here are looked for, and made, as
            ``microslip run`` does.

    Returns:
        What `harmonic_response`, `follow` and `backbone` take; its ``messages`` are sentences one should know.

    Raises:
        UserError: names that the modal files do not hold, and every other mistake, with its key.

    Examples:
        >>> import microslip as ms
        >>> rub = {"interface": "right", "normal_force": 20.0, "normal_stiffness": 2e5, "tangential_stiffness": 4e5,
        ...        "friction": 0.2, "points": [4, 2]}
        >>> case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "contacts": [rub]}
        >>> ms.assemble(case, vane=ms.sample()).assembly.contacts[0].name
        'right'
    """
    path = Path(folder) / "case" if isinstance(case, Mapping) else Path(folder) / case
    raw = _said(case) if isinstance(case, Mapping) else load_toml(path)
    settings = validate(case_model(), raw, path)
    unknown = sorted(set(bases) - {b.name for b in settings.components})
    if unknown:
        raise UserError(
            f"there is no body '{unknown[0]}'; it has {', '.join(b.name for b in settings.components)}", "bases"
        )
    found = {name: b if isinstance(b, ModalBasis) else read_basis(b) for name, b in bases.items()}
    missing = [b for b in settings.components if b.name not in found]
    if missing:
        files = modal_files(settings, Path(folder), report, {name: Path() for name in found})
        found |= {b.name: read_basis(files[b.name]) for b in missing}
    if normal_force is not None:
        bare = [swept(c) and not settings.is_thrown(c) for c in settings.contacts]
        pressed = {"normal_force": normal_force}
        own = [c.model_copy(update=pressed) if b else c for c, b in zip(settings.contacts, bare, strict=True)]
        settings = settings.model_copy(update={"contacts": tuple(own)})
    return build(settings, found)


def _said(case: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case, with a name and a sweep that nobody asks for where it does not say them."""
    sweep = {**unasked_sweep(case), "normal_forces": list(UNPRESSED)}
    return {"name": "assembly", "sweep": sweep, **case}
