"""`microslip contact`: what a file says is drawn and told; every mistake is one sentence with file and field."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("jax")
pytest.importorskip("matplotlib")
ROOT = Path(__file__).resolve().parents[1]


def python(program: str, **environment: str) -> str:
    """What a fresh process prints; it must say nothing else."""
    given = {**os.environ, "PYTHONPATH": str(ROOT / "pipeline"), "OMP_NUM_THREADS": "1", **environment}
    given.pop("JAX_COMPILATION_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", program], env=given, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout


COMPILED = """
import jax, jax.numpy as jnp
from microslip.contact.examples import EXAMPLES
from microslip.contact.law import history
seen = []
jax.monitoring.register_event_listener(lambda event, **_: seen.append(event))
law = EXAMPLES["point, heated"].law
print(float(history(law, jnp.full((9, 1, 3), 1e-5), 1e-4).force[-1, 0, 0]), "/jax/compilation_cache/cache_hits" in seen)
"""


def test_compiled_programs_are_kept_between_runs(tmp_path: Path) -> None:
    """The second process takes the program from the cache and finds the same force."""
    first, second = (python(COMPILED, XDG_CACHE_HOME=str(tmp_path)).split() for _ in range(2))
    assert first[1] == "False" and second[1] == "True"
    assert first[0] == second[0]
    assert list((tmp_path / "microslip" / "jax").iterdir())


@pytest.mark.skipif(os.name != "posix", reason="a folder that cannot be made")
def test_without_a_place_for_the_cache_nothing_is_said() -> None:
    program = "from microslip.contact import law; print(law.keep_compiled())"
    assert python(program, XDG_CACHE_HOME="/proc/none").strip() == "None"
