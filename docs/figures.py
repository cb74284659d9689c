"""Figures of the book by their numbers, each as a picture and a table in the book's quantities without dimension:

    python docs/figures.py 6.6-4 6.7-5 [--figures svg]      build/figures/fig-6.6-4.png, .svg, .csv

Without a number all that there are are listed. Those of a contact law are `microslip contact NUMBER`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import figure_study
import heat_study
import numpy as np
import rolling_study

from microslip.files.png import draw_beside
from microslip.files.tables import write_columns
from microslip.pictures.plots import figure_of, panels, save_figure

FIGURES: dict[str, Callable[[Any], None]] = figure_study.FIGURES | rolling_study.FIGURES | heat_study.FIGURES


def drawn(number: str, figure: Any) -> None:
    (axes,) = panels(figure, (6.4, 4.6))
    FIGURES[number](axes)
    axes.set_title("")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8)
    figure.suptitle(f"Sextro, Fig. {number}")


def plain(words: str) -> str:
    """A label without TeX."""
    return re.sub(r"[$\\{}]", "", words).replace("^*", "*")


def table(axes: Any) -> dict[str, Any]:
    """A row a point of its curves, or a cell of its map."""
    names = [plain(axes.get_xlabel()), plain(axes.get_ylabel())]
    if axes.collections and not axes.lines:
        (cells,) = axes.collections
        at = cells.get_coordinates()
        x, y = (0.25 * (c[1:, 1:] + c[:-1, 1:] + c[1:, :-1] + c[:-1, :-1]) for c in (at[..., 0], at[..., 1]))
        columns = (x.ravel(), y.ravel(), np.asarray(cells.get_array()).ravel())
        return dict(zip([*names, plain(cells.colorbar.ax.get_ylabel())], columns, strict=True))
    curves = [(str(line.get_label()), *map(np.asarray, line.get_data())) for line in axes.lines]
    labels = np.concatenate([np.full(len(x), "" if label.startswith("_") else plain(label)) for label, x, _ in curves])
    return {"curve": labels, names[0]: np.concatenate([x for _, x, _ in curves]),
            names[1]: np.concatenate([y for *_, y in curves])}  # fmt: skip


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("numbers", nargs="*", choices=[*FIGURES, []], metavar="NUMBER", help=", ".join(FIGURES))
    asked.add_argument("--figures", choices=("svg", "pdf", "300dpi"), help="as vector graphics too")
    asked.add_argument("--output", type=Path, default=Path("build") / "figures", help="folder")
    given = asked.parse_args()
    if not given.numbers:
        print("\n".join(FIGURES))
    draw_beside(given.figures)
    for number in given.numbers:
        figure = figure_of(partial(drawn, number))
        place = save_figure(figure, given.output / f"fig-{number}.png")
        write_columns(table(figure.axes[0]), 8, place.with_suffix(".csv"))
        print(place)


if __name__ == "__main__":
    main()
