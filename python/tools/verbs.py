"""Write `lanesweep/_verbs.py`, the verbs as functions, from what the program says of its flags.

``python tools/verbs.py`` writes the file for the module that is installed; a test compares it.
"""

from __future__ import annotations

import keyword
import re
import textwrap
from pathlib import Path
from typing import Any

from lanesweep import _core

FUNCTIONS = ["study", "tracks", "mine", "fit", "sample", "map", "check", "trace", "merge", "devices"]
#: Flags of a case that are the keys of `Case` in Python.
CASE = """category ego_speed speed gap thw lateral_speed lateral_distance acceleration end_speed ahead_speed ahead_gap
    length width ego_length ego_width lane_width""".split()
#: Flags that are no arguments. Gap and headway are arguments too: a recorded scenario can start from others than its own.
ELSEWHERE = dict.fromkeys(["check", "trace"], set(CASE) - {"gap", "thw"}) | dict.fromkeys(["study", "sample"], {"shard", "plan", "plan_only"})
#: Examples of the docstrings; tests run them.
EXAMPLES = {
    "study": """
        >>> result = lanesweep.study(synth_recordings=2, models=["Reg157", "FSM"])
        >>> result.table("results").shape[0] > 100
        True""",
    "tracks": """
        >>> recordings = lanesweep.tracks(convert="recordings", synth_recordings=1)  # in highD's format
        >>> "nothing contradicts itself" in lanesweep.tracks(recordings).text
        True""",
    "mine": """
        >>> mined = lanesweep.mine(lanesweep.tracks(convert="recordings", synth_recordings=1))
        >>> lanesweep.study(scenarios=mined, thw=1.2).status
        'ok'""",
    "fit": """
        >>> fitted = lanesweep.fit(synth_recordings=4, categories="cut-in", parameterizations=2)
        >>> list(fitted.densities)
        ['cut-in-2']""",
    "sample": """
        >>> fitted = lanesweep.fit(synth_recordings=4, categories="cut-in", parameterizations=2)
        >>> estimates = lanesweep.sample(fitted, samples=20_000, thw=0.6, models="FSM").table("estimates")
        >>> estimates["criterion"].tolist()
        ['collision', 'ttc', 'btn']""",
    "map": """
        >>> found = lanesweep.map("cut-in", x="gap_m=5..40/5", y="lateral_speed_mps=0.5..1.5/0.5", set={"ego_speed_kmh": 60, "other_speed_kmh": 40})
        >>> len(found.table("cells"))
        96""",
    "check": """
        >>> case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 15, "lateral_speed": 1}
        >>> lanesweep.check(case).status
        'preventable'""",
    "trace": """
        >>> case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 15, "lateral_speed": 1}
        >>> steps = lanesweep.trace(table=case, models="FSM").table("steps")
        >>> steps.columns[:3]
        ['t_s', 'x_ego_m', 'v_ego_mps']""",
    "devices": """
        >>> print(lanesweep.devices())  # doctest: +SKIP""",
}
#: Types of arguments, by their names.
NAMES = {
    "categories": "Categories", "category": "Category", "compare": "Keys | bool", "config": "Config", "criterion": "Criterion",
    "device": "str | Int", "external": "Paths | Mapping[str, Any]", "file": "Path | Case | Table", "lane": "Values", "models": "Models",
    "panel": "Values", "parameterizations": "Keys", "paths": "Paths", "profiles": "Paths", "proposal": "Path",
    "scenarios": "Path | Table", "set": "Values", "table": "Path | Case | Table", "thw": "Headways",
}  # fmt: skip
#: Types of arguments, by the names of their values on the command line.
VALUES = {
    "N": "Int", "FRACTION": "Float", "s": "Number", "m": "Number", "m/s": "Number", "m/s²": "Number", "h": "Float", "km": "Float",
    "km/h|m/s": "Speed", "I/N": "str", "ID": "str", "NAME": "str", "NAME=RANGE": "str", "TEXT": "str",
}  # fmt: skip
WIDTH = 120
HEAD = '''"""Verbs of the program as functions: the same work, with values as arguments and a `Result` in place of text.

Written by ``python tools/verbs.py`` from the help of the program.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

from ._result import Result
from ._run import run
from .options import {types}

__all__ = [{names}]
'''


def type_of(argument: dict[str, Any], function: str) -> str:
    """The annotation of an argument."""
    name, value = argument["name"], argument["value"]
    if value is None:
        return "bool"
    if name == "thw" and function in ("check", "trace"):
        return "Number"
    if name in NAMES:
        return NAMES[name]
    words = argument["words"] or (value.split("|") if value.islower() and "/" not in value and "|" in value else [])
    if words:
        return f"Literal[{', '.join(repr(word) for word in words)}]".replace("'", '"')
    return VALUES.get(value, "Path")


def python_name(name: str) -> str:
    return f"{name}_" if keyword.iskeyword(name) else name


def in_python(text: str) -> str:
    """A help text with arguments in place of flags: `--half-width` is `half_width`. A command stays one."""
    parts = text.split("`")
    flag = re.compile(r"(?<![\w-])--([a-z][a-z-]*)")
    for at, part in enumerate(parts):
        is_command = at % 2 == 1 and " " in part
        mark = "`" if at % 2 == 0 else ""
        if not is_command:
            parts[at] = flag.sub(lambda found: mark + python_name(found[1].replace("-", "_")) + mark, part)
    text = re.sub(r"[;.] [Rr]epeatable$", "", "`".join(parts).strip().removesuffix("."))
    return re.sub(r"\s*\[default: (.*?)\]", r", by default \1", text)


def sentence(text: str) -> str:
    text = in_python(text)
    return text if text.endswith((".", ":", "?")) else f"{text}."


def paragraphs(text: str, indent: str) -> str:
    wrapped = (textwrap.fill(sentence(" ".join(part.split())), WIDTH, initial_indent=indent, subsequent_indent=indent) for part in text.split("\n\n") if part.strip())
    return "\n\n".join(wrapped)


def written(function: str) -> tuple[str, set[str]]:
    """The source of a function, and the types that it uses."""
    verb = _core.described(function)
    types: set[str] = set()
    positions, others, documented = [], [], []
    for argument in sorted(verb["arguments"], key=lambda one: not one["is_position"]):
        if argument["name"] in ELSEWHERE.get(function, ()):
            continue
        name, annotation = python_name(argument["name"]), type_of(argument, function)
        types |= set(re.findall(r"\b[A-Z]\w+", re.sub(r'"[^"]*"', "", annotation)))
        default = "" if argument["is_required"] else " = False" if annotation == "bool" else " = None"
        optional = " | None" if default == " = None" else ""
        (positions if argument["is_position"] else others).append(f"    {name}: {annotation}{optional}{default},")
        help_text = " ".join(sentence(part) for part in argument["help"].split("\n\n"))
        unit = f", {argument['value']}" if annotation in ("Float", "Number") and argument["value"] != "FRACTION" else ""
        documented.append(f"    {name} : {annotation}{unit}\n" + paragraphs(help_text, " " * 8))
    signature = "\n".join([*positions, "    *,", *others])
    about, _, more = verb["about"].partition("\n\n")
    doc = f'    """{sentence(about)}\n\n' + (paragraphs(more, "    ") + "\n\n" if more else "")
    doc += "    Parameters\n    ----------\n" + "\n".join(documented) + '\n\n    Returns\n    -------\n    Result\n'
    if function in EXAMPLES:
        doc += "\n    Examples\n    --------\n" + textwrap.indent(textwrap.dedent(EXAMPLES[function]).strip(), "    ") + "\n"
    doc += '    """'
    body = f'    return run("{function}", locals())'
    return f"\n\ndef {function}(\n{signature}\n) -> Result:\n{doc}\n{body}\n", types


def case() -> str:
    """The source of `Case`."""
    known = {one["name"]: one for one in _core.described("check")["arguments"]}
    types = {name: "Category" if name == "category" else "Speed" if "speed" in name and name != "lateral_speed" else "Number" for name in CASE}
    units = {name: f" ({known[name]['value']})" if types[name] == "Number" else "" for name in CASE}
    keys = "".join(f'    {name}: {types[name]}\n    """{sentence(known[name]["help"] + units[name])}"""\n' for name in CASE)
    keys += "".join(f'    {name}_kmh: Float\n' for name in CASE if types[name] == "Speed") + "    duration: Number\n"
    return f'\n\nclass Case(TypedDict, total=False):\n    """One case, as a mapping. A table of cases has these names as columns."""\n\n{keys}'


def module() -> str:
    """The source of `_verbs.py`."""
    made = [written(function) for function in FUNCTIONS]
    types = sorted(set().union({"Category", "Float", "Number", "Speed"}, *(types for _, types in made)) - {"Any", "Case", "Literal", "Mapping", "None"})
    names = "".join(f'\n    "{name}",' for name in sorted(["Case", *FUNCTIONS]))
    head = HEAD.format(types="(" + "".join(f"\n    {one}," for one in types) + "\n)", names=names + "\n")
    return head + case() + "".join(text for text, _ in made)


if __name__ == "__main__":
    (Path(__file__).parents[1] / "lanesweep" / "_verbs.py").write_text(module(), encoding="utf-8")
