"""Write sarsim/kernels.json, a list of functions that numba compiles for the default episode: ``list_kernels.py``."""

import json
import os
import tempfile
from pathlib import Path
from typing import Any

OWN_PACKAGES = ("pipeline", "sarsim")
KERNEL_LIST = Path(__file__).resolve().parents[1] / "sarsim" / "kernels.json"

try:
    from sarsim.commands.cli import run
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None


def list_kernels() -> None:
    """Run the default episode with an empty cache, and write the list of the compiled functions to kernels.json."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = f"{folder}/cache"  # numba reads this when it is imported
        lines = [json.dumps(one) for one in compiled_functions(Path(folder, "episode"))]
    KERNEL_LIST.write_text("[\n" + ",\n".join(lines) + "\n]\n")
    print(f"{len(lines)} functions in {KERNEL_LIST}")


def compiled_functions(out: Path) -> list[tuple[str, list[Any]]]:
    """The functions that numba compiles in the default episode, as in :func:`sarsim.compilation.listed_functions`."""
    from numba.core import event

    from sarsim.episode import Episode
    from sarsim.settings import EpisodeConfig

    with event.install_recorder("numba:compile") as recorder:
        Episode(EpisodeConfig(out=out)).run()
    ends = [entry.data for _, entry in recorder.buffer if entry.is_end]
    functions = [(data["dispatcher"].py_func, data["args"]) for data in ends]
    return [
        (f"{function.__module__}:{function.__qualname__}", list(map(argument_type, arguments)))
        for function, arguments in functions
        if function.__module__.partition(".")[0] in OWN_PACKAGES and "<locals>" not in function.__qualname__
    ]


def argument_type(argument: Any) -> Any:
    """The type of an argument, in the form of :data:`sarsim.compilation.Argument`."""
    from numba import types

    if isinstance(argument, types.Array):
        return ["array", str(argument.dtype), argument.ndim, argument.layout, not argument.mutable]
    if isinstance(argument, types.Literal):
        return ["literal", argument.literal_value]
    if isinstance(argument, types.Omitted):
        return ["omitted", argument.value]
    if isinstance(argument, types.BaseTuple):
        kind = getattr(argument, "instance_class", None)
        name = f"{kind.__module__}:{kind.__qualname__}" if kind else None
        return ["tuple", name, list(map(argument_type, argument))]
    return str(argument)


def main() -> None:
    """Entry point."""
    run(list_kernels)


if __name__ == "__main__":
    main()
