"""Run docs/episode.ipynb in a temporary folder, and store the outputs in the notebook."""

import base64
import io
import json
from contextlib import chdir, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.pyplot as plt

NOTEBOOK = Path(__file__).parents[2] / "docs" / "episode.ipynb"
DPI = 80


def cell_outputs(printed: str) -> list[dict[str, Any]]:
    """The outputs of a cell that has just run, in notebook format: the printed text and the open figures."""
    made: list[dict[str, Any]] = []
    if printed:
        made.append({"name": "stdout", "output_type": "stream", "text": printed.splitlines(keepends=True)})
    for number in plt.get_fignums():
        image = io.BytesIO()
        plt.figure(number).savefig(image, dpi=DPI, bbox_inches="tight", metadata={"Software": None})
        data = {"image/png": base64.b64encode(image.getvalue()).decode(), "text/plain": ["<Figure>"]}
        made.append({"data": data, "metadata": {}, "output_type": "display_data"})
    plt.close("all")
    return made


def draw() -> None:
    """Run all cells in order."""
    plt.switch_backend("agg")
    content = json.loads(NOTEBOOK.read_text())
    space: dict[str, Any] = {}
    with TemporaryDirectory() as folder, chdir(folder):
        for count, cell in enumerate((c for c in content["cells"] if c["cell_type"] == "code"), 1):
            printed = io.StringIO()
            with redirect_stdout(printed):
                exec(compile("".join(cell["source"]), NOTEBOOK.name, "exec"), space)
            cell["outputs"], cell["execution_count"] = cell_outputs(printed.getvalue()), count
    NOTEBOOK.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n")
