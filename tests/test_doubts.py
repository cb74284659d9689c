"""Amplitudes that look like numbers in a wrong unit are doubted by every analysis that prints one."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from microslip.cli import main
from microslip.verbs import stability

VANE = """
name = "s"
body = "vane-eigenmodes"
monitor = "probe"
direction = "x"
modes = 2
[[excitations]]
row = "magnet"
amplitude = {newtons}
"""
RUBS = """
[[contacts]]
interface = "right"
law = "smooth"
normal_force = 20.0
normal_stiffness = 2e5
tangential_stiffness = 4e5
friction = 0.2
points = [1, 1]
includes = "surface"
"""
TOUCHES = 'against = "left"\nagainst_sector = 1\n'
SLIDES = RUBS.replace('"smooth"', '{ kind = "rate", slope = 1e3 }').replace('"surface"', '"bulk+surface"')
SLIDES += "ground = { velocity = 1.0 }\n"
ASKED = {
    "orbit": RUBS + "[orbit]\nfrequency = 390.0\nsettle = 1\nkeep = 1\nsamples = 32\n",
    "two-tones": """
[[excitations]]
row = "magnet"
amplitude = 0.1
tone = 2
"""
    + RUBS
    + "[two_tones]\nstart = 390.0\nsecond = 171.3\nharmonics = 1\n",
    "mistune": RUBS
    + TOUCHES
    + """
[ring]
blades = 4
engine_order = 1
[sweep]
start = 380.0
stop = 410.0
points = 7
[mistuning]
samples = 1
stuck = true
[[mistuning.scatter]]
of = "frequency"
deviation = 0.01
""",
    "stability": SLIDES
    + """
[stability]
frequency = [0.0, 1000.0]
[stability.cycle]
parameter = "velocity"
keys = { "contacts.right.ground.velocity" = 1.0 }
start = 0.5
stop = 1.0
""",
}


@pytest.mark.parametrize(
    "verb", [pytest.param(v, marks=pytest.mark.slow) if v == "two-tones" else v for v in ASKED]
)
@pytest.mark.parametrize(("newtons", "doubted"), [(0.1, False), (1e5, True)])
def test_an_amplitude_beyond_a_body_is_doubted(
    verb: str,
    newtons: float,
    doubted: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """On the terminal and on the page, with the amplitude that the analysis found; of limit cycles it is given."""
    monkeypatch.chdir(tmp_path)
    cycles = SimpleNamespace(own=(), relief=(), whole=True, largest=1e-6 * newtons)
    monkeypatch.setattr(stability, "born", lambda *_, **__: cycles)
    assert main(["init", "sample", "s"]) == 0
    (tmp_path / "s" / "case.toml").write_text(VANE.format(newtons=newtons) + ASKED[verb])
    assert main([verb, "s", "--no-pictures"]) in (0, 1)
    said = "".join(capsys.readouterr())
    pages = "".join(p.read_text() for p in (tmp_path / "build" / "s").glob("*.html"))
    for text in (said, pages):
        assert bool(re.search("probe.{1,9}moves by .* of its body", text)) == doubted, text
