"""Pictures and the self-contained page of a body."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..basis import read_basis
from ..data import ModalBasis
from ..files import store
from ..files.png import BESIDE
from ..ring.resonances import resonance_csv, resonances, speeds_of
from .job import Job
from .modal import warnings_of
from .stage import Made, Report, Stage


def report_stage(
    job: Job, response: dict[str, Any] | None, force: bool, report: Report, draw: bool = True
) -> Path:  # fmt: skip
    """Pictures, if they are wanted, and the self-contained page of a body."""
    from ..report.body import report_html

    stage = Stage(job.build_folder / "report.html", ("stages.page",), force, report)
    folder, messages, shown = job.build_folder / "pictures", _messages(job), dict[str, str]()
    if response is not None:
        messages += response.get("messages", [])
        shown = dict(response.get("pictures", {}))
        response = {k: v for k, v in response.items() if k not in ("messages", "pictures")}
    engine_orders = list(job.settings.rotation.engine_orders)

    def work() -> Made:
        basis = read_basis(job.basis_file)
        stage.begin()
        drawn, reason = _drawn(basis, folder, engine_orders, report) if draw else ({}, None)
        messages.extend([f"The pictures of the body are missing: {reason}"] if reason else [])
        tables: list[Path] = []
        if basis.sectors > 1 and (basis.ranges or len(speeds_of(basis)) > 1):
            tables = [job.build_folder / "resonances.csv"]
            store.write_text(tables[0], resonance_csv(resonances(basis, engine_orders)))
        drawn |= {title: folder / name for title, name in shown.items()}
        report("writing the report")
        store.write_text(stage.product, report_html(basis, drawn, messages, response))
        return Made([*drawn.values(), *tables], whole=reason is None)

    inputs = {
        "basis": store.hash_file(job.basis_file),
        "response": response,
        "engine_orders": engine_orders,
        "messages": list(messages),
        "pictures": draw and (BESIDE.get() or True),
    }
    stage.make(inputs, work)
    return stage.product


def _drawn(
    basis: ModalBasis, folder: Path, engine_orders: Sequence[int], report: Report
) -> tuple[dict[str, Path], str | None]:
    """The pictures of a body, and why those by PyVista are not there."""
    from .. import pictures

    report("starting PyVista")
    reason = pictures.can_draw()
    if reason is not None:
        report(f"warning: no pictures of the body: {reason}")
    return pictures.draw_all(basis, folder, report, engine_orders, scenes=reason is None), reason


def _messages(job: Job) -> list[str]:
    return [*([job.settings.note] if job.settings.note else []), *warnings_of(job.basis_file)]
