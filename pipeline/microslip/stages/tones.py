"""Quasi-periodic vibration of a case under two tones: a table, all amplitudes in HDF5, pictures and a page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analyses import two_tones
from ..basis import read_basis
from ..case import CaseSettings, load_case
from ..case.assemble import build
from ..data import UserError
from ..files import store
from ..files.tables import rows_csv
from ..harmonic_balance.tones import Kept
from ..report.tones import tones_html
from ..results import open_journal
from ..units import Quantity
from .checkpoint import inputs_of
from .stage import Made, Report, Stage, hash_of_code

if TYPE_CHECKING:
    from ..results.tones import TwoTones


def tones_stage(
    case_path: Path, files: Mapping[str, Path], folder: Path, assignments: list[str] | None = None,
    force: bool = False, report: Report = lambda _: None, pictures: bool = True,
) -> tuple[list[Path], list[str], bool]:  # fmt: skip
    """What a case asks for in [two_tones], in a folder.

    Args:
        files: body of the case -> its modal file.

    Returns:
        The files, sentences, and whether every point converged.

    Raises:
        UserError: the case asks for none; see `microslip.two_tones`.
    """
    settings, raw = load_case(case_path, assignments)
    if settings.two_tones is None:
        raise UserError(f"{case_path}: two_tones: is missing; add [two_tones] with start and second (Hz), or ratio")
    stage = Stage(folder / "two_tones.json", ("stages.tones",), force, report)
    inputs = {**inputs_of(raw, settings, case_path, files), "pictures": pictures}
    depends = store.hash_settings({**inputs, "pictures": None, "code": hash_of_code(stage.code)})
    stage.make(inputs, lambda: _work(stage, settings, case_path, files, pictures, depends))
    told = json.loads(stage.product.read_text())
    return [folder / name for name in told["files"]], told["sentences"], told["converged"]


def _work(
    stage: Stage, settings: CaseSettings, case_path: Path, files: Mapping[str, Path], pictures: bool, inputs: str
) -> Made:  # fmt: skip
    """Finished points stay in a journal until all that is made of them is there."""
    folder, asked = stage.product.parent, settings.two_tones
    assert asked is not None
    built = build(settings, {name: read_basis(file) for name, file in files.items()}, case_path)
    first, second = asked.hertz
    points = folder / "two_tones.points"
    folder.mkdir(parents=True, exist_ok=True)
    with open_journal(points, inputs, {"case": settings.name}, stage.force) as journal:
        try:
            found = two_tones(
                built, first, second, free=asked.free, harmonics=asked.harmonics, samples=asked.samples,
                turns=asked.turns, kept=Kept(journal), report=stage.report,
            )  # fmt: skip
        except UserError as error:
            if not journal.series:
                points.unlink()
            raise UserError(f"{case_path}: two_tones: {error}") from error
    stage.begin()
    best = int(np.argmax(np.where(found.converged, np.abs(found.of(1, 0)), -1.0)))
    left_out = found.error_estimate(best) if found.converged[best] else np.inf
    messages = [*_sentences(found, best, left_out), *found.messages, *built.messages]
    columns = found.columns()
    cells = ([v if isinstance(v, str) else f"{v:.10g}" for v in row] for row in zip(*columns.values(), strict=True))
    store.write_text(folder / "two_tones.csv", rows_csv(list(columns), cells))
    found.save(folder / "two_tones.h5")
    drawn = _pictures(found, best, folder / "pictures", settings.name) if pictures else []
    store.write_text(folder / "two_tones.html", tones_html(f"{settings.name}: two tones", found, best, messages, drawn))
    made = [*(folder / f"two_tones.{end}" for end in ("html", "csv", "h5")), *drawn]
    told = {
        "files": [str(path.relative_to(folder)) for path in made],
        "sentences": messages,
        "converged": bool(found.converged.all()),
    }
    store.write_text(stage.product, json.dumps(told, indent=1) + "\n")
    points.unlink()
    return Made(made)


def _sentences(found: TwoTones, i: int, error: float) -> list[str]:
    said = [f"{f:.6g} Hz: {why}" for f, why in found.failures]
    if not found.converged[i]:
        return said
    sized = Quantity(found.units[0]).sized
    one, two = (sized(float(abs(found.of(*k)[i]))) for k in ((1, 0), (0, 1)))
    kept = f"{100 * error:.2g} % of the largest amplitude" if np.isfinite(error) else "an unknown share"
    return [
        f"{found.first[i]:.6g} and {found.second[i]:.6g} Hz: {found.readouts[0]} swings by {one} and {two}; the "
        f"estimated error is {kept}.",
        *said,
    ]


def _pictures(found: TwoTones, i: int, folder: Path, case: str) -> list[Path]:
    from ..pictures.tones import curves_picture, point_picture

    folder.mkdir(exist_ok=True)
    title = f"{case}: {found.first[i]:.6g} and {found.second[i]:.6g} Hz"
    drawn = [point_picture(found, i, folder / "two_tones_point.png", title)] if found.converged[i] else []
    if len(found) > 1 and found.converged.any():
        drawn.insert(0, curves_picture(found, folder / "two_tones.png", case))
    return drawn
