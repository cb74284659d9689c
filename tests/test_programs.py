"""Compiled programs that are kept whole: read by what they were made from, or made anew."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

import microslip as ms
from microslip import programs
from microslip.contact import jenkins, patch
from microslip.contact.law import Law, settings

DIR, LEAST = "jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs"
PLACES = np.zeros((2, 1, 3)) + np.array([1e-6, 0.0, 0.0])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(programs, "kept_in", lambda: tmp_path)
    monkeypatch.setattr(patch._tangents, "made", {})
    return tmp_path


@pytest.fixture
def law() -> Law:
    return ms.jenkins(1e5, 10.0).law


def _unread(idle: Any, x: Any) -> Any:
    return 2 * x


def _solved(A: Any, b: Any) -> Any:
    return jnp.linalg.solve(A, b)


def again(law: Any) -> np.ndarray:
    """As a process that begins."""
    patch._tangents.made.clear()
    return np.asarray(patch._tangents(law, PLACES))


def kept(folder: Path) -> set[Path]:
    return set(folder.glob("*-program"))


def test_a_program_is_read_with_the_same_bits(folder: Path, law: Law, monkeypatch: pytest.MonkeyPatch) -> None:
    first = again(law)
    assert len(kept(folder)) == 1
    monkeypatch.setattr(programs, "_compiled", lambda *_: pytest.fail("compiled"))
    np.testing.assert_array_equal(again(law), first)
    np.testing.assert_array_equal(again(ms.jenkins(2e5, 10.0).law), 2 * first)  # numbers are no part of it


def test_what_is_damaged_is_made_again(folder: Path, law: Law) -> None:
    first = again(law)
    for file in folder.iterdir():
        file.write_bytes(file.read_bytes()[:1000])
    np.testing.assert_array_equal(again(law), first)
    again(law)
    assert [file.stat().st_size > 1000 for file in kept(folder)] == [True]


def test_what_lacks_a_part_is_made_again(folder: Path, law: Law, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler reads it without a word and says so when it is run."""

    def lacking(*_: Any, **__: Any) -> Any:
        raise programs.jax.errors.JaxRuntimeError("NOT_FOUND: Function not found")

    first = again(law)
    with monkeypatch.context() as patched:
        patched.setattr(programs, "_read", lambda *_: lacking)
        np.testing.assert_array_equal(again(law), first)
    np.testing.assert_array_equal(again(law), first)


def test_a_replaced_constant_or_function_makes_another_program(
    folder: Path, law: Law, monkeypatch: pytest.MonkeyPatch
) -> None:
    again(law)
    for owner, name, value in ((jenkins, "SHARE", 3.0), (jenkins.Jenkins, "step", lambda *given: given)):
        with monkeypatch.context() as patched:
            patched.setattr(owner, name, value, raising=name == "step")
            asked = programs.Program._file(patch._tangents, _asked(law))
            assert asked is not None and not asked.exists()
    asked = programs.Program._file(patch._tangents, _asked(law))
    assert asked is not None and asked.exists()


@settings
class Strange(Law):
    """A law of another package."""

    stiffness: Any

    def init(self, n: int) -> Any:
        return jnp.zeros((2, n))

    def step(self, u: Any, v: Any, dt: Any, state: Any) -> Any:
        return self.stiffness * u, state


def test_what_is_not_of_this_package_is_not_kept(folder: Path, law: Law) -> None:
    assert programs.Program._file(patch._tangents, _asked(Strange(jnp.asarray(1.0)))) is None
    double = programs.program(lambda x: 2 * x)
    assert float(double(3.0)) == 6.0 and not kept(folder)


def _asked(law: Law) -> tuple[Any, Any, Any]:
    leaves, tree = programs.jax.tree_util.tree_flatten(((law, PLACES), {}))
    return tree, tuple(map(programs._type, leaves)), ()


def test_arguments_that_a_program_does_not_need_are_part_of_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler does not read them; a program is called with arguments of its own shapes alone."""
    unread = programs.Program(_unread, None)
    monkeypatch.setattr(programs, "PACKAGE", __name__)
    monkeypatch.setattr(programs, "_run", lambda made, given: [made(*given[0], **given[1])] if made else [])
    for n in (1, 4, 1):
        unread.made.clear()
        assert float(unread(np.zeros(n), 2.0)) == 4.0
    assert len(kept(folder)) == 2


def test_options_of_the_compiler_are_part_of_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the compiler reads is the same; what is kept for hundreds of points is not read for a few."""
    monkeypatch.setattr(programs, "PACKAGE", __name__)
    for options in (None, {"xla_cpu_prefer_vector_width": 512}):
        assert float(programs.Program(_unread, options)(np.zeros(3), 2.0)) == 4.0
    assert len(kept(folder)) == len(set(folder.glob("*-compiled"))) == 2


def test_names_of_sources_are_not_kept(folder: Path, law: Law) -> None:
    again(law)
    (program,) = kept(folder)
    assert program.read_bytes().count(b"while") and not program.read_bytes().count(b"programs.py")
    assert not program.read_bytes().count(b"jit(_tangents)/")


def test_what_jax_had_kept_is_not_written_again(
    folder: Path, law: Law, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It lacks parts that are missed when it is run."""
    jax, kept_by_jax = programs.jax, tmp_path / "jax"
    monkeypatch.setattr(programs, "_READ", set())
    before = {name: getattr(jax.config, name) for name in (DIR, LEAST)}
    compilation_cache.reset_cache()
    jax.config.update(DIR, str(kept_by_jax))
    jax.config.update(LEAST, 0.0)
    try:
        for _ in range(2):
            jax.clear_caches()
            lowered = patch._tangents.traced.lower(law, PLACES)
            first = np.asarray(lowered.compile(patch._tangents.options)(law, PLACES))
        assert list(kept_by_jax.glob("jit__tangents-*"))
        jax.clear_caches()
        np.testing.assert_array_equal(again(law), first)
        np.testing.assert_array_equal(again(law), first)
        assert not kept(folder) and programs._READ
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
        compilation_cache.reset_cache()


@pytest.mark.slow
def test_another_process_finds_them(tmp_path: Path) -> None:
    """By names that do not hang on the order of sets in a process."""
    ask = (
        "import numpy as np, microslip as ms; s = ms.structure(1.0, 100.0, 0.1, force={0: 1.0}, output=0, "
        "elements=[ms.jenkins(1e2, 0.5)]); print(ms.harmonic_response(s, np.linspace(1, 3, 5), harmonics=1).amplitude)"
    )
    said, held = [], []
    for seed in "12":
        environment = os.environ | {"PYTHONHASHSEED": seed, "JAX_COMPILATION_CACHE_DIR": str(tmp_path)}
        found = subprocess.run([sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=True)
        said.append(found.stdout)
        held.append(kept(tmp_path))
    assert said[0] == said[1] and held[0] == held[1] and held[0]


@pytest.mark.slow
def test_a_process_that_has_lowered_nothing_finds_lapack(tmp_path: Path) -> None:
    """It called what nobody had looked for, and ended."""
    solve = f"""
import sys
sys.path.append({str(Path(__file__).parent)!r})
import test_programs as t
t.programs.PACKAGE = t.__name__
t.programs.kept_in = lambda: t.Path({str(tmp_path)!r})
if t.kept(t.programs.kept_in()):
    t.programs._compiled = None
print(t.programs.Program(t._solved, None)(2 * t.np.eye(2), t.np.ones(2)).tolist())
"""
    for _ in range(2):
        assert subprocess.check_output([sys.executable, "-c", solve], text=True).strip() == "[0.5, 0.5]"
        assert len(kept(tmp_path)) == 1
