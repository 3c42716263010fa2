"""Writes lanesweep/_verbs.py from the definition of the command line: `python tools/generate.py`, with the module installed."""

from __future__ import annotations

import importlib.util
import json
import keyword
import sys
import textwrap
from pathlib import Path
from types import ModuleType

# Verb of the program → function; what it leaves in a temporary place if no `out` is given.
FUNCTIONS = {
    "study": ("study", "study"),
    "tracks": ("tracks", "tracks"),
    "mine": ("mine", "scenarios.jsonl"),
    "fit": ("fit", "densities"),
    "sample": ("sample", "sample"),
    "compare": ("compare", "compare"),
    "search": ("search", "search"),
    "justify": ("justify", "dossier"),
    "map": ("map", "map"),
    "check": ("check", None),
    "simulate": ("trace", None),
    "export xosc": ("export_xosc", None),
    "synth": ("synth", None),
    "cluster merge": ("merge", None),
}
# Set by the functions themselves, or without a meaning here.
LEFT_OUT = {"out", "format", "quiet", "verbose", "tables"}
WIDTH = 120


def name_of(argument: dict, verb: str) -> str:
    name = argument["id"]
    if name == "dir":
        name = "folder" if verb in ("synth", "cluster merge") else "recordings"
    return name + "_" if keyword.iskeyword(name) else name


def type_of(argument: dict) -> str:
    if not argument["takes_value"]:
        return "bool"
    if argument["flag"] == "models":
        return "Models | None"
    if argument["is_list"] or argument["repeats"] or argument["value_name"] == "LIST":
        return "Values | None"
    return "Value | None"


def paragraph(text: str, indent: int) -> str:
    words = " ".join(text.split())
    return textwrap.fill(words, WIDTH - indent, initial_indent=" " * indent, subsequent_indent=" " * indent)


def documented(verb: dict, arguments: list[dict], default_out: str | None) -> str:
    first, *rest = [part for part in verb["help"].strip().split("\n\n") if part.strip()]
    lines = [f'    """{" ".join(first.split())}', ""]
    lines += [line for part in rest for line in (paragraph(part.replace("\\", "\\\\"), 4), "")]
    lines += ["    Parameters", "    ----------"]
    for argument in arguments:
        unit = argument["value_name"] or ""
        note = f", {unit}" if unit and unit.islower() and unit not in {"auto|cpu|gpu"} and len(unit) < 8 else ""
        default = f", default {argument['default']}" if argument["default"] and argument["takes_value"] else ""
        kind = type_of(argument).replace(" | None", "")
        lines.append(f"    {name_of(argument, verb['verb'])} : {kind}{note}{default}")
        parts = [part.strip().rstrip(".") for part in argument["help"].split("\n\n") if part.strip()]
        lines.append(paragraph(". ".join(parts).replace("\\", "\\\\") + ".", 8))
        if argument["choices"] and argument["takes_value"]:
            lines.append(paragraph("One of " + ", ".join(argument["choices"]) + ".", 8))
    if default_out is not None:
        lines += ["    out : path, optional", "        Where the files stay; without it they go with the result."]
    lines += ["", "    Returns", "    -------", "    Result", '    """']
    return "\n".join(lines)


def function(verb: dict) -> str:
    name, default_out = FUNCTIONS[verb["verb"]]
    has = {argument["id"] for argument in verb["arguments"]}
    arguments = [argument for argument in verb["arguments"] if argument["id"] not in LEFT_OUT]
    positions = [argument for argument in arguments if argument["flag"] is None]
    flags = [argument for argument in arguments if argument["flag"] is not None]
    name_in = {a["id"]: name_of(a, verb["verb"]) for a in arguments}
    parameters = [f"    {name_in[a['id']]}: " + ("Value" if a["is_required"] else f"{type_of(a)} = None") for a in positions]
    parameters.append("    *,")
    parameters += [f"    {name_in[a['id']]}: {type_of(a)} = {'None' if a['takes_value'] else 'False'}" for a in flags]
    has_out = "out" in has
    if has_out:
        is_required = any(a["id"] == "out" and a["is_required"] for a in verb["arguments"])
        parameters.append("    out: Path" if is_required else "    out: Path | None = None")
    parameters = [line if line.endswith(",") else line + "," for line in parameters]
    given = [f"        ({a['flag']!r}, {name_in[a['id']]}, {a['is_list'] or a['value_name'] == 'LIST'})," for a in arguments]
    call = [f"    return run(", f"        {verb['verb']!r},", "        ["]
    call += ["    " + line for line in given] + ["        ],"]
    if has_out:
        call.append("        out=out,")
        call.append(f"        default_out={default_out!r},")
    elif verb["verb"] in ("synth", "cluster merge"):
        call.append("        path=folder,")
    call.append("    )")
    body = documented(verb, arguments, default_out if has_out else None)
    return "\n".join([f"def {name}(", *parameters, ") -> Result:", body, *call])


def core() -> ModuleType:
    """The installed compiled module, without the package, which needs what is written here."""
    package = importlib.util.find_spec("lanesweep")
    assert package is not None and package.submodule_search_locations, "install the module first"
    (file,) = Path(package.submodule_search_locations[0]).glob("_core.*[od]")
    spec = importlib.util.spec_from_file_location("lanesweep._core", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def text() -> str:
    verbs = {verb["verb"]: verb for verb in json.loads(core().definition())}
    head = '''"""Verbs of the program as functions. Written by tools/generate.py; do not edit."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from ._driver import Driver
from ._result import Result
from ._run import run

Path: TypeAlias = str | os.PathLike[str]
Value: TypeAlias = str | float | Path
Values: TypeAlias = Value | Sequence[Value] | Mapping[str, Value]
Models: TypeAlias = str | Driver | Sequence[str | Driver]
'''
    functions = [function(verbs[verb]) for verb in FUNCTIONS]
    names = sorted(name for name, _ in FUNCTIONS.values())
    exported = "__all__ = [\n" + "".join(f"    {name!r},\n" for name in names) + "]\n"
    return head + "\n" + exported.replace("'", '"') + "\n\n" + "\n\n\n".join(functions) + "\n"


if __name__ == "__main__":
    path = Path(__file__).parents[1] / "lanesweep" / "_verbs.py"
    if "--check" in sys.argv:
        sys.exit(0 if path.read_text(encoding="utf-8") == text() else f"{path} is not that of this program: run generate.py")
    path.write_text(text(), encoding="utf-8")
