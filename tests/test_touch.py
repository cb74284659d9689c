"""Curves of a page that can be touched are those of its picture, number by number."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import LogNorm

from microslip.files.png import CURVES, text_in, with_text
from microslip.pictures.plots import save_figure, single_panel
from microslip.pictures.touch import curves_of, tell_points
from microslip.report.page import answer_page


def figure() -> tuple:
    """Two curves of 20 and 100 N, and the points of the first, which tell their damping."""
    drawn, axes = single_panel(6.0, 4.0)
    f = np.linspace(100.0, 200.0, 11)
    heights = [1.0 / np.hypot(150.0 - f, 5.0 * k) for k in (1, 2)]
    axes.plot(f, heights[0], "--", color="#123456", label="$F_N$ = 20 N")
    axes.plot(f, heights[1], "o-", color="#654321", label="$F_N$ = 100 N")
    tell_points(axes, f, heights[0], {"frequency in Hz": f, "damping in %": np.full(11, 0.25)}, "#123456", "F_N = 20 N")
    axes.axhline(0.1, color="0.5")
    axes.set(yscale="log", xlabel="frequency in Hz", ylabel="amplitude in µm", title="response")
    return drawn, f, heights


def test_curves_are_those_of_the_picture(tmp_path: Path) -> None:
    drawn, f, heights = figure()
    png = save_figure(drawn, tmp_path / "response.png").read_bytes()
    curves = json.loads(text_in(png, CURVES))
    one, two, points, level = curves["data"]
    for trace, y in ((one, heights[0]), (two, heights[1]), (points, heights[0])):
        np.testing.assert_allclose(trace["x"], f, rtol=1e-6)
        np.testing.assert_allclose(trace["y"], y, rtol=1e-6)
    assert [one["name"], one["line"]["dash"], one["mode"]] == ["F<sub>N</sub> = 20 N", "dash", "lines"]
    assert two["mode"] == "lines+markers" and one["legendgroup"] == points["legendgroup"] == "#123456"
    assert points["text"][3] == "frequency in Hz: 130<br>damping in %: 0.25"
    assert one["hoverinfo"] == "skip"  # its points tell
    np.testing.assert_allclose(level["y"], 0.1, rtol=1e-6)
    layout = curves["layout"]
    assert layout["yaxis1"]["type"] == "log" and layout["xaxis1"]["title"]["text"] == "frequency in Hz"
    np.testing.assert_allclose(10 ** np.array(layout["yaxis1"]["range"]), drawn.axes[0].get_ylim())


def test_a_map_keeps_its_cells_and_what_is_no_curve_stays_a_picture() -> None:
    drawn, axes = single_panel(6.0, 4.0)
    z = np.array([[1.0, 10.0, np.nan], [2.0, 20.0, 200.0]])
    shades = axes.pcolormesh([0.0, 1.0, 2.0, 3.0], [0.0, 5.0, 10.0], z, norm=LogNorm(1, 200))
    drawn.colorbar(shades, label="amplitude in µm")
    (trace,) = curves_of(drawn)["data"]
    assert trace["x"] == [0.0, 1.0, 2.0, 3.0] and trace["y"] == [0.0, 5.0, 10.0]
    assert trace["text"][1] == ["2", "20", "200"] and trace["colorbar"]["title"]["text"] == "amplitude in µm"
    axes.bar([1.0], [2.0])
    assert curves_of(drawn) is None


def test_a_text_in_a_picture_is_found_again_and_its_pixels_stay(tmp_path: Path) -> None:
    from PIL import Image

    png = save_figure(figure()[0], tmp_path / "one.png").read_bytes()
    (tmp_path / "two.png").write_bytes(with_text(png, "more", "µ"))
    assert text_in((tmp_path / "two.png").read_bytes(), "more") == "µ" and text_in(b"GIF89a", CURVES) == ""
    assert text_in(png[:-30], "more") == ""
    one, two = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("one", "two"))
    assert (one == two).all()


HOVER = """<script>
addEventListener("load", () => setTimeout(() => {
  const place = document.querySelector(".touch");
  Plotly.Fx.hover(place, [{ curveNumber: 2, pointNumber: 3 }]);
  document.body.dataset.hover = place.querySelector(".hoverlayer").textContent;
  document.body.dataset.zoomed = place._fullLayout.xaxis.range.join(" ");
}, 1500));
</script></body>"""


@pytest.mark.slow
def test_a_browser_draws_the_curves_and_a_hover_reads_the_number(tmp_path: Path) -> None:
    """From a file, without a network: the curve stands where the picture stood, and no script fails."""
    pytest.importorskip("plotly")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("chromium is not installed")
    save_figure(figure()[0], tmp_path / "response.png")
    page = tmp_path / "page.html"
    text = answer_page("response", ["The highest is 0.2 µm."], [tmp_path / "response.png"])
    page.write_text(text.replace("</body>", HOVER), encoding="utf-8")
    assert len(text) < 6e6 and not re.search(r'(src|href)="(?!data:|#)', text)
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", f"--user-data-dir={tmp_path}"]
    line = [chromium, *options, "--virtual-time-budget=8000", "--dump-dom", f"file://{page}"]
    run = subprocess.run(line, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in run.stderr, run.stderr
    hover = re.search(r'data-hover="([^"]*)"', run.stdout)
    assert hover and "frequency in Hz: 130" in hover[1] and "damping in %: 0.25" in hover[1], run.stdout[-2000:]
    assert re.search(r'<img[^>]*style="display: none;"', run.stdout)
    assert base64.b64encode(b"\x89PNG")[:4].decode() in run.stdout  # without scripts the picture stands there
