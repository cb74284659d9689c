"""Force over approach of one closure of a body: a table, a picture and a page."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ..analysis import Answer, Files
from ..errors import UserError, in_its_file
from ..files.tables import write_columns
from ..mesh import UNITS
from ..report.response import number_tables
from ..units import METRES, from_rpm
from .answer import Written, made
from .job import Job
from .meshing import load_mesh, mesh_stage
from .modal import with_temperature
from .stage import Report, Stage


@in_its_file
def closure_stage(
    job: Job, name: str | None, low: float, high: float, points: int, rpm: float, output: Path | None = None,
    report: Report = lambda _: None,
) -> Written:  # fmt: skip
    """Force over approach of one closure, in build/<name>/ or `output`; computed whenever it is asked for.

    Args:
        name: of the closure; None for the only one. low, high: approach of the faces, in the body's length_unit.

    Raises:
        UserError, NotConverged: see `modes.closure_curve`.
    """
    known = [c.name for c in job.settings.closures]
    if name not in (known if len(known) != 1 else [*known, None]):
        raise UserError(f"the body has {', '.join(known) or 'none'}; name one of them", "closures")
    if not low < high or points < 2:
        raise UserError("closure --from, --to, --points: give two or more points over a rising approach")
    chosen, levels = name or known[0], np.linspace(low, high, points) * UNITS[job.settings.length_unit]
    product = (output or job.basis_file.parent) / f"closure_{chosen}.json"
    stage = Stage(product, ("modal.closures",), True, report, None if output else job.path)
    title = f"{job.settings.name}: closure '{chosen}' at {rpm:g} rpm"

    def solve(_: object) -> Answer:
        from ..modal.compute import closure_curve
        from ..pictures.plots import closure_curve_plot

        mesh, warnings = load_mesh(job, mesh_stage(job, report=report))
        settings, temperature = with_temperature(job, mesh)
        curve = closure_curve(mesh, settings, chosen, levels, from_rpm(rpm), temperature, report)
        files: Files = {
            f"closure_{chosen}.csv": partial(write_columns, curve.columns, 9),
            f"closure_{chosen}.png": lambda path: closure_curve_plot(curve, title, path),
        }
        last = (
            f"At {METRES.sized(levels[-1])} the faces are pressed by {curve.force[-1]:.5g} N, "
            f"{100 * curve.closed_share[-1]:.3g} % of the area in contact; the stiffness there is "
            f"{curve.stiffness[-1]:.4g} N/m."
        )
        said = [last, *(f"warning: {text}" for text in warnings)]
        return Answer(said, tables=number_tables({f"closure_{chosen}.csv": curve.columns}), files=files)

    return made(stage, {}, title, True, solve)
