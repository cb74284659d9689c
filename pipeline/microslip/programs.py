"""Programs: pure functions of arrays, compiled once for each shape, and kept between processes as they were compiled.

To trace a contact law in Python takes longer than to run it a thousand times, and jax traces anew in every process,
though it keeps what its compiler made. Here the whole program is kept beside that, by all it was made from: function,
static arguments, shapes and types, compiler, options, processor, and the modules of this package that the function and
the classes of its arguments come from, their sources and what they hold now. What hangs on anything else, a law of
another package or a function that has no name, is traced as jax does.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial, update_wrapper
from io import BytesIO
from operator import is_
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any
from weakref import WeakSet

import jax
import jax.numpy as jnp
import numpy as np

from .errors import UserError
from .process import kept_in, prepare

KNOWN = (0, 6) <= jax.__version_info__ < (0, 11)  # other versions may not know the options
LEFT_OUT = "while-loop-invariant-code-motion" if (0, 10) <= jax.__version_info__ else ""
"""Passes of the compiler: this one makes a loop anew for each value that it takes out of it, which is half of the time
that a march takes to compile, and what it takes out is no faster for it. Older versions take no list of them."""
PACKAGE = __name__.partition(".")[0]
NAMED = {PACKAGE, "numpy", "jax", "jaxlib", "builtins", "collections", "functools", "copyreg", "pathlib"}
"""Packages whose classes and functions a kept program may name."""

Given = tuple[tuple[Any, ...], dict[str, Any]]
"""Arguments by their places and by their names."""

_ALL: WeakSet[Program] = WeakSet()
_READ = set[str]()
"""Programs that this process has from what jax keeps."""


class Program:
    """`jax.jit` of a function with options of the compiler, in a process that is ready for it; see the module.

    Args:
        function. options: of the compiler, None for those of the process. static_argnums, static_argnames: arguments
            that are part of the program, hashable.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        options: dict[str, Any] | None,
        static_argnums: int | tuple[int, ...] = (),
        static_argnames: str | tuple[str, ...] = (),
    ) -> None:
        self.function = function
        update_wrapper(self, function)
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        numbers = (static_argnums,) if isinstance(static_argnums, int) else static_argnums
        words = (static_argnames,) if isinstance(static_argnames, str) else static_argnames
        self._names = {*words, *(names[i] for i in numbers)}
        self._numbers = {i for i, name in enumerate(names) if name in self._names}
        left_out = {"xla_disable_hlo_passes": LEFT_OUT} if LEFT_OUT else {}
        self.options = {**(options or {}), **left_out} if KNOWN else None
        self.traced = jax.jit(function, static_argnames=tuple(self._names))
        self.made: dict[Any, Callable[..., Any]] = {}
        _ALL.add(self)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        prepare()
        static: tuple[Any, ...] = ()
        given = args, kwargs
        if self._names:
            static = *(x for i, x in enumerate(args) if i in self._numbers), *_named(kwargs, self._names)
            given = (
                tuple(x for i, x in enumerate(args) if i not in self._numbers),
                {name: x for name, x in kwargs.items() if name not in self._names},
            )
        leaves, tree = jax.tree_util.tree_flatten(given)
        types = tuple(map(_type, leaves))
        if None in types:  # part of another program
            return self.traced(*args, **kwargs)
        asked = tree, types, static
        if (made := self.made.get(asked)) is not None:
            return made(*given[0], **given[1])
        file = self._file(asked)
        read = _read(file, tree)
        if read is not None and (out := _run(read, given)):
            self.made[asked] = read
        else:
            lowered = _lowered(self.traced.trace(*args, **kwargs))
            self.made[asked], out = _compiled(file, lowered, self.options, given)
        return out[0]

    def _file(self, asked: tuple[Any, Any, Any]) -> Path | None:
        """Where a program is kept; None if it hangs on what has no name, or nothing is kept."""
        folder, (tree, types, static) = kept_in(), asked
        if folder is None or jax.default_backend() != "cpu":
            return None
        name, arguments = self.function.__qualname__, jax.tree_util.tree_unflatten(tree, range(len(types)))
        if "<" in name or self.function.__module__.partition(".")[0] != PACKAGE:  # made while running, or elsewhere
            return None
        try:
            said = _Said(self.function.__module__)
            said.dump((name, self.options, arguments, types, static, _machine()))
        except Exception:  # whatever a class of somebody else's raises
            return None
        digest = hashlib.sha256(said.text)
        for module in sorted(said.modules.union(*map(_used, said.modules))):
            digest.update(_source(module))
            digest.update(_held(sys.modules[module]))
        return folder / f"{self.function.__name__}-{digest.hexdigest()}-program"


program = partial(Program, options={"xla_cpu_use_fusion_emitters": False})
"""`jax.jit` of what python calls: compiled in half the time, and slower only where there are hundreds of points."""

inner = partial(Program, options=None)
"""The same of what other programs call too, which choose the options."""

often = partial(Program, options={"xla_cpu_prefer_vector_width": 512})
"""The same of hundreds of points: compiled half a second longer, and a third faster."""

seldom = partial(Program, options={"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 0})
"""The same of what is called some dozens of times: compiled in a quarter of the time, half as fast."""


def _named(kwargs: dict[str, Any], names: set[str]) -> list[tuple[str, Any]]:
    """Those of some names that were given; one that is left out is not one that is None."""
    return sorted((name, x) for name, x in kwargs.items() if name in names)


def dropped() -> None:
    """Programs that this process holds are read or compiled again when they are asked for; their memory is free."""
    for one in _ALL:
        one.made.clear()
    jax.clear_caches()


def _type(x: Any) -> Any:
    """What of an argument is part of a program, None of what another program is being traced with."""
    if isinstance(x, jax.core.Tracer):
        return None
    if isinstance(x, jax.Array):
        return x.shape, x.dtype, x.weak_type
    if isinstance(x, np.ndarray | np.generic):
        return x.shape, x.dtype
    return type(x) if isinstance(x, bool | int | float | complex) else None


# what a program was made from ---------------------------------------------------------------------------------------


class _Said(pickle.Pickler):
    """Bytes of values that are the same in every process, and the modules of this package that they name.

    Raises:
        UserError: they name what is of another package, or has no name.
    """

    def __init__(self, *modules: str) -> None:
        self._text, self.modules = BytesIO(), set(modules)
        super().__init__(self._text, protocol=5)

    @property
    def text(self) -> bytes:
        return self._text.getvalue()

    def dump(self, made: Any) -> None:
        self.fast = True  # or it hangs on which of alike words are one object
        super().dump(made)

    def reducer_override(self, made: Any) -> Any:
        if isinstance(made, type | FunctionType):
            if made.__module__.partition(".")[0] not in NAMED:
                raise UserError(f"{made.__module__} is another package")
            if made.__module__.partition(".")[0] == PACKAGE:
                self.modules.add(made.__module__)
        return NotImplemented


@cache
def _used(name: str) -> frozenset[str]:
    """The modules of this package that a module names, and those that they name."""
    found, left = set[str](), [name]
    while left:
        found.add(at := left.pop())
        for value in vars(sys.modules[at]).values():
            one = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(one, str) and one in sys.modules and one.partition(".")[0] == PACKAGE and one not in found:
                left.append(one)
    return frozenset(found)


@cache
def _source(name: str) -> bytes:
    """Hash of a module's file, as it was when it was first asked for."""
    return hashlib.sha256(Path(sys.modules[name].__file__ or "").read_bytes()).digest()


_SEEN = dict[ModuleType, tuple[list[Any], bytes]]()


def _held(module: ModuleType) -> bytes:
    """Constants of a module and where the code of its functions stands: some of them may have been replaced."""
    own, (before, said) = list(_owned(module)), _SEEN.get(module, ([], b""))
    if len(own) != len(before) or not all(map(is_, own, before)):
        _SEEN[module] = own, (said := _constants(module))
    return said


def _owned(module: ModuleType) -> Iterator[Any]:
    """What stands in a module and in its classes."""
    for value in vars(module).values():
        yield value
        if isinstance(value, type) and value.__module__ == module.__name__:
            yield from vars(value).values()


def _constants(module: ModuleType) -> bytes:
    said = _Said()
    for name, value in sorted(vars(module).items()):
        if not name.startswith("__"):
            said.dump((name, *_code(name, value)))
    return said.text


def _code(name: str, value: Any) -> Iterator[Any]:
    if isinstance(value, type):
        for inner, one in sorted(vars(value).items()):
            if isinstance(one, FunctionType):
                yield from _code(inner, one)
    elif code := getattr(getattr(value, "__wrapped__", value), "__code__", None):
        yield os.path.basename(code.co_filename), code.co_firstlineno, code.co_name
    elif isinstance(value, int | float | complex | str | np.ndarray | tuple):
        try:
            said = _Said()
            said.dump(value)
            yield said.text
        except Exception:  # names what has no name
            yield type(value).__name__


@cache
def _machine() -> tuple[str, ...]:
    """Versions, flags, and what the processor can do: a folder may be shared by machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    except OSError:
        processor = platform.processor()
    given = os.environ.get("XLA_FLAGS", ""), os.environ.get("NPROC", "")
    versions = jax.__version__, jax.lib.__version__, np.__version__, platform.python_version()
    return *versions, platform.machine(), processor, *given


def _read(file: Path | None, tree: Any) -> Callable[..., Any] | None:
    """A program, its arguments in a tree; None if it is not kept, or what is kept is damaged."""
    if file is None or not file.is_file():
        return None
    from jax.experimental.serialize_executable import deserialize_and_load

    try:
        compiled, found = pickle.loads(file.read_bytes())
        os.utime(file)
        if b"lapack_" in compiled:
            _find_lapack()
        return deserialize_and_load(compiled, tree, jax.tree_util.tree_structure(found))
    except Exception:  # whatever damage does; it is compiled again, and kept anew
        return None


@cache
def _find_lapack() -> None:
    """jax looks for LAPACK where it lowers a call of it; a program that was read calls what nobody looked for, and the
    process ends."""
    jax.jit(jnp.linalg.inv).lower(np.eye(1))


def _lowered(traced: Any) -> Any:
    """For the compiler, without the lines of the sources and the names that each operation comes from: they are a
    third of what is kept, and are read again with it."""
    from jaxlib.mlir.passmanager import PassManager

    with _told("jax_traceback_in_locations_limit", 0):
        lowered = traced.lower()
    module = lowered.compiler_ir()
    with module.context:
        PassManager.parse("builtin.module(strip-debuginfo)").run(module.operation)
    return lowered


@contextmanager
def _told(name: str, value: Any) -> Iterator[None]:
    """A setting of jax for a while."""
    before = getattr(jax.config, name)
    jax.config.update(name, value)
    try:
        yield
    finally:
        jax.config.update(name, before)


def _run(read: Callable[..., Any] | None, given: Given) -> list[Any]:
    """What a program that was read finds; nothing if it is not whole, which it says when it is run."""
    if read is None:
        return []
    try:
        return [jax.block_until_ready(read(*given[0], **given[1]))]
    except (jax.errors.JaxRuntimeError, TypeError):
        return []


def _compiled(file: Path | None, lowered: Any, options: Any, given: Given) -> tuple[Callable[..., Any], list[Any]]:
    """A program and what it finds: compiled and kept, unless one that reads the same for the compiler was kept when
    sources differed."""
    made, same, found = None, _alike(file, lowered, options, given), list[Any]()
    if same is not None and not (found := _run(made := _read(same, jax.tree_util.tree_structure(given)), given)):
        made, ours = _once(lowered, options)
        _READ.update([] if ours else [same.name])
        same = same if ours and _keep(same, made, lowered.out_tree) else None
    if file is not None and same is not None:
        with suppress(OSError):
            file.unlink(missing_ok=True)
            os.link(same, file)
    made = made or lowered.compile(options)
    return made, found or [made(*given[0], **given[1])]


def _alike(file: Path | None, lowered: Any, options: Any, given: Given) -> Path | None:
    """Where a program is kept by what the compiler reads, which leaves out arguments that it does not need, by its
    options and by its arguments; None if it is not to be kept."""
    if file is None:
        return None
    try:
        leaves, tree = jax.tree_util.tree_flatten(given)
        trees = _numbered(tree), _numbered(lowered.out_tree)
        (said := _Said()).dump((lowered.as_text(), options, trees, tuple(map(_type, leaves)), _machine()))
    except (UserError, pickle.PicklingError):  # a class of another package
        return None
    same = file.with_name(f"{hashlib.sha256(said.text).hexdigest()}-compiled")
    return None if same.name in _READ else same


def _numbered(tree: Any) -> Any:
    """Something with this structure."""
    return jax.tree_util.tree_unflatten(tree, range(tree.num_leaves))


def _keep(same: Path, made: Any, out: Any) -> bool:
    """Whether a program could be written, whole or not at all."""
    from jax.experimental.serialize_executable import serialize

    try:
        (said := _Said()).dump((serialize(made)[0], _numbered(out)))
        with tempfile.NamedTemporaryFile(dir=same.parent, delete=False) as part:
            part.write(said.text)
        os.replace(part.name, same)
    except (OSError, ValueError, NotImplementedError):  # no place, or constants beside the program
        return False
    return True


def _once(lowered: Any, options: Any) -> tuple[Any, bool]:
    """Compiled, and not kept by jax too; and whether it was compiled here: what jax had kept cannot be written again,
    though nothing says so before it is read and run."""
    read = list[str]()

    def heard(event: str, **_: Any) -> None:
        if event == "/jax/compilation_cache/cache_hits":
            read.append(event)

    jax.monitoring.register_event_listener(heard)
    try:
        with _told("jax_persistent_cache_min_compile_time_secs", np.inf):
            return lowered.compile(options), not read
    finally:
        jax.monitoring.unregister_event_listener(heard)
