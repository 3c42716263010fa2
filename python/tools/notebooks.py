"""Runs the notebooks and writes them, with their output, into a folder: `python tools/notebooks.py FOLDER`.

The output beside the sentences has to be that of today: a notebook whose numbers are lanesweep's alone must print what is
stored. `python tools/notebooks.py notebooks` stores what it prints.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
# Their last digits depend on the machine.
OTHERS = ("import openturns", "from sklearn")


def texts(notebook: nbformat.NotebookNode) -> list[str]:
    """What every cell prints, without figures and pages."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output.get("text") or output.data["text/plain"] for output in outputs]


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    stale = []
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        start = time.monotonic()
        notebook = nbformat.read(path, as_version=4)
        stored = texts(notebook)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
        # What differs from run to run is left out.
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)
            if cell.cell_type == "code":
                cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
        notebook.metadata.pop("widgets", None)
        notebook.metadata["language_info"] = {"name": "python"}
        nbformat.write(notebook, folder / path.name)
        print(f"{path.name}: {time.monotonic() - start:.0f} s")
        if texts(notebook) != stored and not any(other in path.read_text() for other in OTHERS):
            stale.append(path.name)
    if stale and folder.resolve() != NOTEBOOKS:
        sys.exit(f"{', '.join(stale)}: prints something else than what is stored; run tools/notebooks.py notebooks")


if __name__ == "__main__":
    main()
