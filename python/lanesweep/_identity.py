"""What a driver is: a digest of the code that it runs, and of the values that this code reads.

Read are the class and its bases, attributes, and what their functions reach: functions, constants of modules, closures,
defaults, recursively. Installed packages count by name and version. What code finds by a computed name is not seen.
"""

from __future__ import annotations

import copyreg
import ctypes
import dis
import functools
import hashlib
import importlib
import importlib.metadata
import sys
import sysconfig
import types
from _ctypes import CFuncPtr
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

_PLAIN = (type(None), type(...), type(NotImplemented), bool, int, float, complex, str, bytes, range)
_STDLIB = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib")})
#: Objects that hold functions, and where.
_WRAPPERS: dict[type, tuple[str, ...]] = {
    staticmethod: ("__func__",),
    classmethod: ("__func__",),
    property: ("fget", "fset", "fdel"),
    functools.cached_property: ("func",),
    functools.partial: ("func", "args", "keywords"),
    functools.partialmethod: ("func", "args", "keywords"),
    types.MethodType: ("__func__", "__self__"),
}


class Unreadable(Exception):
    """A value that cannot be compared with that of another run: where it is, and why."""

    def __init__(self, where: str, value: Any, why: object) -> None:
        super().__init__(f"{where} is a `{type(value).__qualname__}`, which cannot be compared between runs ({why})")


def digest(*values: Any) -> str:
    """Return a digest of values, the first of which is the subject of an `Unreadable` error."""
    walk = _Walk()
    for value in values:
        walk.add(value, "it")
    return walk.hash.hexdigest()[:16]


class _Walk:
    """Feeds a hash with all that is reached, each object once."""

    def __init__(self) -> None:
        self.hash = hashlib.sha256()
        # By identity, which stays an object's while it lives: its position, and the object.
        self.seen: dict[int, tuple[int, Any]] = {}

    def say(self, *words: object) -> None:
        text = repr(words).encode("utf-8", "backslashreplace")
        self.hash.update(len(text).to_bytes(8, "little") + text)

    def is_first(self, value: Any) -> bool:
        if id(value) in self.seen:
            self.say("again", self.seen[id(value)][0])
            return False
        self.seen[id(value)] = len(self.seen), value
        return True

    def add(self, value: Any, where: str) -> None:
        """Add a value, which is found at a place."""
        if type(value) in _PLAIN:
            self.say(type(value).__name__, value)
        elif isinstance(value, types.ModuleType):
            self._module(value)
        elif (installed := _installed(value)) is not None:
            self.say("installed", *installed)
            # What a package made of one's own functions.
            self._closure(value, f"`{value.__qualname__}`")
        elif self.is_first(value):
            self._first(value, where)

    def _module(self, module: types.ModuleType) -> None:
        """Add a module that is a value: of one that is not installed, all that it holds."""
        self.say("module", module.__name__, _version(module.__name__.partition(".")[0]))
        if not _is_installed(module.__name__) and self.is_first(module):
            for name in sorted(name for name in vars(module) if not name.startswith("__")):
                self.say(name)
                self.add(vars(module)[name], f"`{module.__name__}.{name}`")

    def _first(self, value: Any, where: str) -> None:
        wrapped = next((names for kind, names in _WRAPPERS.items() if type(value) is kind), None)
        if isinstance(value, type):
            self._class(value)
        elif isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.CodeType):
            self._code(value, where)
        elif wrapped is not None:
            self.say(type(value).__name__)
            for name in wrapped:
                self.add(getattr(value, name), where)
        elif type(value) in (list, tuple, set, frozenset):
            self.say(type(value).__name__, len(value))
            is_ordered = type(value) in (list, tuple)
            for at, item in enumerate(value if is_ordered else sorted(value, key=lambda item: (type(item).__name__, repr(item)))):
                self.add(item, f"{where}[{at}]")
        elif type(value) in (dict, types.MappingProxyType):
            self.say("dict", len(value))
            for key in sorted(value) if all(type(key) is str for key in value) else value:
                self.add(key, f"a key of {where}")
                self.add(value[key], f"{where}[{key!r}]")
        elif type(value) is np.ndarray and value.dtype.kind != "O":
            self.say("array", value.dtype.descr, value.shape)
            self.hash.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, CFuncPtr):
            self.say("function of C", getattr(value, "__name__", None))
            self.add(list((value._objects or {}).values()), where)
        elif isinstance(value, ctypes.CDLL):
            file = Path(value._name or "")
            self.say("library", hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else value._name)
        elif callable(inner := getattr(value, "__wrapped__", None)):
            # A jitted or cached function.
            self.say("wrapper", type(value).__qualname__)
            self.add(inner, where)
        else:
            self._instance(value, where)

    def _instance(self, value: Any, where: str) -> None:
        """Add what `pickle` stores, with the code of the classes and functions in it."""
        try:
            reduce = copyreg.dispatch_table.get(type(value))
            stored = reduce(value) if reduce is not None else value.__reduce_ex__(4)
        except Exception as error:
            raise Unreadable(where, value, error) from error
        parts = [stored] if isinstance(stored, str) else [list(p) if isinstance(p, Iterator) else p for p in stored]
        self.say("instance", len(parts))
        self.add(type(value), where)
        for part in parts:
            if type(part) is dict:  # the attributes, or what `__getstate__` returns
                self.say("state", len(part))
                for name in sorted(part, key=repr):
                    self.say(name)
                    self.add(part[name], f"attribute `{name}`" if where == "it" else f"{where}.{name}")
            else:
                self.add(part, where)

    def _class(self, kind: type) -> None:
        self.say("class", kind.__qualname__, [base.__qualname__ for base in kind.__mro__])
        for base in kind.__mro__:
            if base is not kind:
                if _installed(base) is not None or not self.is_first(base):
                    self.say("installed", *(_installed(base) or ()))
                    continue
            for name, member in sorted(vars(base).items()):
                is_code = isinstance(member, (types.FunctionType, *_WRAPPERS))
                is_special = name == "_abc_impl" or (name.startswith("__") and name.endswith("__"))
                is_slot = isinstance(member, (types.MemberDescriptorType, types.GetSetDescriptorType))
                if is_code or not (is_special or is_slot):
                    self.say(name)
                    self.add(member, f"`{base.__qualname__}.{name}`")

    def _function(self, function: types.FunctionType) -> None:
        name = f"`{function.__qualname__}`"
        self.say("function", function.__qualname__)
        self.add(function.__code__, name)
        self.add(function.__defaults__, f"a default of {name}")
        self.add(function.__kwdefaults__, f"a default of {name}")
        self._closure(function, name)
        around, (loaded, imported) = function.__globals__, _reads(function.__code__)
        names = _names(function.__code__)
        for variable in loaded:
            if variable in around:
                self.say(variable)
                self._read(around[variable], names, f"`{variable}`, which {name} reads,")
        for module in imported:
            self._read(_imported(module, around.get("__package__")), names, f"`{module}`, which {name} imports,")

    def _closure(self, function: Any, name: str) -> None:
        cells = getattr(function, "__closure__", None) or ()
        for variable, cell in zip(function.__code__.co_freevars if cells else (), cells, strict=True):
            try:
                value = cell.cell_contents
            except ValueError:
                self.say("empty")
            else:
                self._read(value, _names(function.__code__), f"`{variable}`, which {name} reads,")

    def _read(self, value: Any, names: set[str], where: str, within: tuple[str, ...] = ()) -> None:
        """Add a value that code reads; of a module that is not installed, all that has one of the code's names."""
        if not isinstance(value, types.ModuleType) or _is_installed(value.__name__) or value.__name__ in within:
            return self.add(value, where)
        for name in sorted(names & vars(value).keys()):
            self.say(name)
            self._read(vars(value)[name], names, f"`{value.__name__}.{name}`", (*within, value.__name__))

    def _code(self, code: types.CodeType, where: str) -> None:
        # Without lines and files: a comment changes nothing.
        self.say(code.co_name, code.co_code, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        self.say(code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
        self.say(getattr(code, "co_exceptiontable", b""))
        self.add(list(code.co_consts), where)


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """The code, and that of the functions within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _names(code: types.CodeType) -> set[str]:
    return {name for one in _codes(code) for name in one.co_names}


@functools.lru_cache(maxsize=4096)
def _reads(code: types.CodeType) -> tuple[list[str], list[str]]:
    """Names of the globals that code reads, and of the modules that it imports."""
    loaded, imported = set(), set()
    for step in (step for one in _codes(code) for step in dis.get_instructions(one)):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            loaded.add(step.argval)
        elif step.opname == "IMPORT_NAME":
            imported.add(step.argval)
    return sorted(loaded), sorted(imported)


def _imported(name: str, package: str | None) -> Any:
    for full in (name, f"{package}.{name}"):
        try:
            return importlib.import_module(full)
        except Exception:
            continue
    return None


def _installed(value: Any) -> tuple[str, str, str] | None:
    """Module, name and version of a class or function of an installed package."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not (isinstance(module, str) and isinstance(name, str) and _is_installed(module)):
        return None
    if isinstance(value, types.MethodType):
        return None  # its object counts
    if isinstance(value, types.FunctionType) and not _is_installed(str(value.__globals__.get("__name__", ""))):
        return None  # a decorator gave it another function's name
    return module, name, _version(module.partition(".")[0])


@functools.lru_cache(maxsize=4096)
def _is_installed(module: str) -> bool:
    """Whether a module changes with the version of its package only."""
    root = module.partition(".")[0]
    if root == "lanesweep":
        return module != "lanesweep.drivers"
    if root in ("__main__", "__mp_main__", ""):
        return False
    if root in sys.builtin_module_names or root in sys.stdlib_module_names:
        return True
    file = str(getattr(sys.modules.get(module), "__file__", None) or getattr(sys.modules.get(root), "__file__", ""))
    return file.startswith(_STDLIB) or "site-packages" in file or "dist-packages" in file


@functools.lru_cache(maxsize=4096)
def _version(package: str) -> str:
    try:
        return str(getattr(sys.modules.get(package), "__version__", "") or importlib.metadata.version(package))
    except Exception:
        return ""
