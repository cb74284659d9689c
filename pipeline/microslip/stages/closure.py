"""Force over approach of one closure of a body: a table and a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import UserError, in_its_file
from ..files import store
from ..mesh import UNITS
from ..units import from_rpm
from .job import Job
from .meshing import load_mesh, mesh_stage
from .modal import with_temperature
from .stage import Made, Report, Stage


@in_its_file
def closure_stage(
    job: Job, name: str | None, low: float, high: float, points: int, rpm: float, output: Path | None = None,
    report: Report = lambda _: None,
) -> list[Path]:  # fmt: skip
    """Force over approach of one closure: CSV and PNG in build/<name>/ or `output`.

    Args:
        name: of the closure; None for the only one. low, high: approach of the faces, in the body's length_unit.

    Raises:
        UserError, NotConverged: see `modes.closure_curve`.
    """
    from ..modal.compute import closure_curve
    from ..pictures.plots import closure_curve_plot

    known = [c.name for c in job.settings.closures]
    if name not in (known if len(known) != 1 else [*known, None]):
        raise UserError(f"the body has {', '.join(known) or 'none'}; name one of them", "closures")
    if not low < high or points < 2:
        raise UserError("closure --from, --to, --points: give two or more points over a rising approach")
    chosen, scale = name or known[0], UNITS[job.settings.length_unit]
    mesh, warnings = load_mesh(job, mesh_stage(job, report=report))
    for warning in warnings:
        report(f"warning: {warning}")
    folder = output or job.basis_file.parent
    table, picture = folder / f"closure_{chosen}.csv", folder / f"closure_{chosen}.png"

    def work() -> Made:
        settings, temperature = with_temperature(job, mesh)
        levels = np.linspace(low, high, points) * scale
        curve = closure_curve(mesh, settings, chosen, levels, from_rpm(rpm), temperature, report)
        store.write_text(table, curve.table())
        title = f"{job.settings.name}: closure '{chosen}' at {rpm:g} rpm"
        return Made([closure_curve_plot(curve, title, picture)])

    origin = None if output else job.path
    Stage(table, ("modal.closures",), True, report, origin).make({}, work)
    return [table, picture]
