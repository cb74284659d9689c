"""Quasi-periodic vibration of a case under two tones: a table, all amplitudes in HDF5, pictures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analyses import two_tones
from ..case import headline
from ..errors import UserError, at, in_its_file
from ..files import store
from ..files.tables import columns_csv
from ..harmonic_balance.tones import Kept
from ..report.tones import tones_html
from ..results import open_journal
from ..units import Quantity
from .answer import Answer, CaseJob
from .stage import Stage

if TYPE_CHECKING:
    from ..results.tones import TwoTones


@in_its_file
def tones_stage(case: CaseJob) -> Answer:
    """What a case asks for in [two_tones]; whole if every point converged.

    Raises:
        UserError: the case asks for none; see `microslip.two_tones`.
    """
    if case.settings.two_tones is None:
        raise UserError("is missing; add [two_tones] with start and second (Hz), or ratio", "two_tones")
    return case.answer("two_tones", "stages.tones", _work)


def _work(stage: Stage, case: CaseJob) -> Answer:
    """Finished points stay in a journal until all that is made of them is there."""
    folder, name, asked = case.folder, case.settings.name, case.settings.two_tones
    assert asked is not None
    built = case.built()
    first, second = asked.hertz
    points = folder / "two_tones.points"
    with (
        at("two_tones"),
        open_journal(points, case.made_by(stage), {"case": name}, case.force) as journal,
    ):
        try:
            found = two_tones(
                built, first, second, free=asked.free, harmonics=asked.harmonics, samples=asked.samples,
                turns=asked.turns, kept=Kept(journal), report=case.report,
            )  # fmt: skip
        except UserError:
            if not journal.series:
                points.unlink()
            raise
    stage.begin()
    best = int(np.argmax(np.where(found.converged, np.abs(found.of(1, 0)), -1.0)))
    left_out = found.error_estimate(best) if found.converged[best] else np.inf
    reached = np.abs(found.amplitude[found.converged, 0, 1:]).sum(axis=-1).max(initial=0.0)
    doubts = headline.doubted(built, float(reached))
    messages = [*_sentences(found, best, left_out), *found.messages, *built.messages, *doubts]
    columns = found.columns()
    store.write_text(folder / "two_tones.csv", columns_csv(columns, 10))
    found.save(folder / "two_tones.h5")
    drawn = _pictures(found, best, folder / "pictures", name) if case.pictures else []
    store.write_text(folder / "two_tones.html", tones_html(f"{name}: two tones", found, best, messages, drawn))
    made = [*(folder / f"two_tones.{end}" for end in ("html", "csv", "h5")), *drawn]
    return Answer(made, messages, bool(found.converged.all()))


def _sentences(found: TwoTones, i: int, error: float) -> list[str]:
    said = [f"{f:.6g} Hz: {why}" for f, why in found.failures]
    if not found.converged[i]:
        return said
    if not found.amplitude[i, 0, 1:].any():
        return [f"{found.readouts[0]} does not move; read another direction or another monitor.", *said]
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

    title = f"{case}: {found.first[i]:.6g} and {found.second[i]:.6g} Hz"
    drawn = [point_picture(found, i, folder / "two_tones_point.png", title)] if found.converged[i] else []
    if len(found) > 1 and found.converged.any():
        drawn.insert(0, curves_picture(found, folder / "two_tones.png", case))
    return drawn
