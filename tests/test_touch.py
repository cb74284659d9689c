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

import microslip as ms
from microslip.files.png import CURVES, draw_beside, text_in, with_text
from microslip.pictures.lettering import save_png
from microslip.pictures.plots import empty_figure, panels, save_figure
from microslip.pictures.touch import curves_of, tell_points
from microslip.pictures.turning import MOST_VERTICES, Outside, Turned, outside, turned, turning_assembly, turning_modes
from microslip.reduced.coordinates import basis_in_modes
from microslip.report.page import answer_page
from microslip.stages.stage import Made, Stage


def figure() -> tuple:
    """Two curves of 20 and 100 N, and the points of the first, which tell their damping."""
    drawn = empty_figure()
    (axes,) = panels(drawn, (6.0, 4.0))
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
    drawn = empty_figure()
    (axes,) = panels(drawn, (6.0, 4.0))
    z = np.array([[1.0, 10.0, np.nan], [2.0, 20.0, 200.0]])
    shades = axes.pcolormesh([0.0, 1.0, 2.0, 3.0], [0.0, 5.0, 10.0], z, norm=LogNorm(1, 200))
    drawn.colorbar(shades, label="amplitude in µm")
    (trace,) = curves_of(drawn)["data"]
    assert trace["x"] == [0.0, 1.0, 2.0, 3.0] and trace["y"] == [0.0, 5.0, 10.0]
    assert trace["text"][1] == ["2", "20", "200"] and trace["colorbar"]["title"]["text"] == "amplitude in µm"
    axes.bar([1.0], [2.0])
    assert curves_of(drawn) is None


def test_every_panel_keeps_its_bar_beside_it() -> None:
    """As the maps of contacts have them; points in shades keep theirs too."""
    drawn = empty_figure()
    for axes, low in zip(drawn.subplots(2, 1), (0.0, 5.0), strict=True):
        shades = axes.scatter([0.0, 1.0], [0.0, 1.0], c=[low, low + 1.0])
        drawn.colorbar(shades, label="in MPa")
    traces = curves_of(drawn)["data"]
    for trace, low, middle in zip(traces, (0.0, 5.0), (0.77, 0.23), strict=True):
        marker = trace["marker"]
        assert (marker["cmin"], marker["cmax"], marker["color"]) == (low, low + 1.0, [low, low + 1.0])
        assert marker["colorbar"]["title"]["text"] == "in MPa" and marker["colorbar"]["x"] > 1.0
        assert marker["colorbar"]["y"] == pytest.approx(middle, abs=0.05)


def test_a_text_in_a_picture_is_found_again_and_its_pixels_stay(tmp_path: Path) -> None:
    from PIL import Image

    png = save_figure(figure()[0], tmp_path / "one.png").read_bytes()
    (tmp_path / "two.png").write_bytes(with_text(png, "more", "µ"))
    assert text_in((tmp_path / "two.png").read_bytes(), "more") == "µ" and text_in(b"GIF89a", CURVES) == ""
    assert text_in(png[:-30], "more") == ""
    one, two = (np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("one", "two"))
    assert (one == two).all()


def test_the_outside_of_a_box_is_closed_and_has_its_edges() -> None:
    """Triangles of a closed surface meet in pairs; sharp are the sides on the twelve edges alone, and modes are those
    of the file to what 16 bits hold."""
    pytest.importorskip("plotly")
    basis = basis_in_modes(ms.read_basis(ms.sample()))
    skin = outside(basis.mesh)
    used, triangles, outline = skin.source, skin.triangles, skin.edges
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()
    assert len(outline) == 4 * 5 + 2 * (2 * 2 + 2 * 1)  # 1 x 2 x 5 elements
    group = basis.groups[min(basis.groups)]
    third = json.loads(turning_modes(basis, group))["shapes"][2]
    expected = group.phi[used, :, 2].real
    expected = expected / np.linalg.norm(expected, axis=1).max()
    np.testing.assert_allclose(third["most"] * numbers(third["parts"][0][0]), expected, atol=2e-5)
    assert third["name"] == f"mode 3: {group.frequency[2]:.5g} Hz"


def numbers(packed: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed), "<i2").reshape(-1, 3) / 32767


def test_harmonics_and_values_of_a_body_are_those_given_and_a_large_one_is_coarser() -> None:
    """Two harmonics of a plate of 150 x 150 points; in the coarser one every vertex is one of them."""
    n = 150
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid / n, 0.02 * np.sin(grid[:, 0] / 9.0)])
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate(
        [np.column_stack([corner, corner + n, corner + 1]), np.column_stack([corner + 1, corner + n, corner + n + 1])]
    )
    skin = Outside(np.arange(n * n), triangles, np.zeros((0, 2), dtype=int))
    moving = np.stack([points * (1 + 2j), 0.5j * points])
    body = json.loads(turned(points, skin, [Turned("both", moving, points[:, 0], "MPa", True)], "<plate>"))
    (shape,), at = body["shapes"], body["scale"] * numbers(body["points"]) + points.mean(axis=0)
    assert len(at) <= 1.01 * MOST_VERTICES and body["title"] == "&lt;plate&gt;"
    gap = np.abs(at[:, None, :2] - points[:: n // 2, :2]).max(axis=2).min(axis=0)
    assert gap.max() < 0.05  # the plate is still whole
    size = np.linalg.norm(moving[0], axis=1).max()
    (real, imag), (_, second) = shape["parts"]
    for part, factor in ((real, 1.0), (imag, 2.0), (second, 0.5)):
        np.testing.assert_allclose(shape["most"] * size * numbers(part), factor * at, atol=2e-4)
    assert shape["high"] == pytest.approx(points[:, 0].max())
    assert shape["grown"] == pytest.approx(body["drawn"] * body["extent"] / size)


def test_bodies_stand_and_move_where_a_case_puts_them() -> None:
    """Two vanes, the second shifted by their length; each moves as it is told, the second half as much."""
    basis = basis_in_modes(ms.read_basis(ms.sample()))
    mesh, phi = basis.mesh, basis.groups[min(basis.groups)].phi[:, :, 0]
    shift = np.array([0.0, 0.0, 0.16])
    parts = [(mesh, mesh.points, phi[None] + 0j), (mesh, mesh.points + shift, 0.5j * phi[None])]
    body = json.loads(turning_assembly(parts, ["first"], "both"))
    at, skin = body["scale"] * numbers(body["points"]), outside(mesh)
    n = len(skin.source)
    assert len(at) == 2 * n
    np.testing.assert_allclose(at[n:] - at[:n], np.tile(shift, (n, 1)), atol=2e-4 * body["scale"])
    ((real, imag),) = body["shapes"][0]["parts"]
    np.testing.assert_allclose(0.5 * numbers(real)[:n], numbers(imag)[n:], atol=1e-4)
    assert not numbers(real)[n:].any() and not numbers(imag)[:n].any()


@pytest.mark.parametrize(("kind", "name"), [("svg", "a.svg"), ("pdf", "a.pdf"), ("300dpi", "a_300dpi.png")])
def test_curves_are_drawn_for_print_beside_and_go_with_their_picture(tmp_path: Path, kind: str, name: str) -> None:
    """A second time to the last byte; the picture of the page stays as it is; the next answer clears them."""
    from PIL import Image

    plain = save_figure(figure()[0], tmp_path / "plain.png").read_bytes()
    draw_beside(kind)
    try:
        pictures = [save_figure(figure()[0], tmp_path / end) for end in ("a.png", "b.png")]
        (tmp_path / "p.json").write_text("{}")
        stage = Stage(tmp_path / "p.json", ("errors",), force=True)
        stage.make({}, lambda: Made(pictures))
    finally:
        draw_beside(None)
    assert (tmp_path / "a.png").read_bytes() == plain
    drawn = (tmp_path / name).read_bytes()
    assert drawn == (tmp_path / name.replace("a", "b", 1)).read_bytes()
    if kind == "300dpi":
        assert Image.open(tmp_path / name).size == (1800, 1200)
    else:
        assert drawn[:5] in (b"<?xml", b"%PDF-")
    stage.begin()
    stage.make({"more": 1}, lambda: Made([pictures[1]]))
    assert not (tmp_path / name).exists() and not (tmp_path / "a.png").exists()


HOVER = """<script>
addEventListener("load", () => setTimeout(() => {
  const place = document.querySelector(".touch");
  Plotly.Fx.hover(place, [{ curveNumber: 2, pointNumber: 3 }]);
  document.body.dataset.hover = place.querySelector(".hoverlayer").textContent;
}, 1500));
</script>"""


def browsed(page: Path, script: str, folder: Path) -> str:
    """The page as a browser has it after a script of its own has run; no other script complains."""
    pytest.importorskip("plotly")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("chromium is not installed")
    page.write_text(page.read_text(encoding="utf-8").replace("</body>", script + "</body>"), encoding="utf-8")
    drawn = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    options = ["--headless", "--no-sandbox", *drawn, "--enable-logging=stderr", f"--user-data-dir={folder}"]
    line = [chromium, *options, "--virtual-time-budget=10000", "--dump-dom", f"file://{page}"]
    run = subprocess.run(line, capture_output=True, text=True, timeout=180, check=True)
    harmless = ("willReadFrequently", "[PST]", "theme mode")
    said = [t for t in run.stderr.splitlines() if "CONSOLE" in t and not any(word in t for word in harmless)]
    assert not said, said
    return run.stdout


@pytest.mark.slow
def test_a_browser_draws_the_curves_and_a_hover_reads_the_number(tmp_path: Path) -> None:
    """From a file, without a network: the curve stands where the picture stood, and no script fails."""
    save_figure(figure()[0], tmp_path / "response.png")
    text = answer_page("response", ["The highest is 0.2 µm."], [tmp_path / "response.png"])
    assert len(text) < 6e6 and not re.search(r'(src|href)="(?!data:|#)', text)
    assert "data:image/webp;base64," in text  # without scripts the picture stands there
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    out = browsed(tmp_path / "page.html", HOVER, tmp_path)
    hover = re.search(r'data-hover="([^"]*)"', out)
    assert hover and "frequency in Hz: 130" in hover[1] and "damping in %: 0.25" in hover[1], out[-2000:]
    assert re.search(r'<img[^>]*style="display: none;"', out)


TURN = """<script>
addEventListener("load", () => setTimeout(async () => {
  const place = document.querySelector(".turning .touch"), choice = document.querySelector(".turning select");
  const first = [...place.data[0].x];
  choice.value = 1;
  await choice.onchange();
  document.body.dataset.moved = Math.max(...first.map((x, n) => Math.abs(x - place.data[0].x[n]))).toFixed(1);
  document.body.dataset.modes = choice.length;
}, 3000));
</script>"""


@pytest.mark.slow
def test_a_browser_turns_a_body_and_changes_its_mode(tmp_path: Path) -> None:
    pytest.importorskip("plotly")
    basis = basis_in_modes(ms.read_basis(ms.sample()))
    from PIL import Image

    body = turning_modes(basis, basis.groups[min(basis.groups)])
    save_png(Image.new("RGB", (9, 9)), tmp_path / "modes.png", body)
    text = answer_page("vane", [], [tmp_path / "modes.png"])
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    out = browsed(tmp_path / "page.html", TURN, tmp_path)
    assert 'data-modes="6"' in out and "<canvas" in out
    moved = re.search(r'data-moved="([^"]*)"', out)
    assert moved and 1.0 < float(moved[1]) < 30.0  # mm, of a vane 160 mm long
