"""The second process that compiles what an episode needs last."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import types
from numba.core.dispatcher import Dispatcher

from pipeline.elevation_map.pose_kernels import Costs
from sarsim.compilation import compile_functions, listed_functions, resolve_name, type_of
from scripts.list_kernels import argument_type
from tests.source_tree import ROOT

ARRAY = types.Array(types.float32, 2, "A", readonly=True)
TYPES = [
    types.int64,
    types.bool,
    ARRAY,
    types.literal(0),
    types.literal(False),
    types.Omitted(None),
    types.UniTuple(types.int64, 3),
    types.Tuple([types.float64, ARRAY]),
    types.NamedUniTuple(types.float64, len(Costs._fields), Costs),
]


@pytest.mark.parametrize("kind", TYPES, ids=str)
def test_types_are_read_back(kind: types.Type) -> None:
    assert type_of(argument_type(kind)) == kind


def test_most_of_the_list_is_in_the_code() -> None:
    found = []
    for name, _ in listed_functions():
        try:
            found.append(isinstance(resolve_name(name), Dispatcher))
        except (ImportError, AttributeError):
            found.append(False)
    assert len(found) > 50 and np.mean(found) > 0.8, "make the list again: scripts/list_kernels.py"


def test_what_is_not_there_is_left_out() -> None:
    compile_functions([("pipeline.nowhere:f", []), ("pipeline.frame:f", ["int64"]), ("json:loads", ["int64"])])


STARTS = """
import os, subprocess, sys
from sarsim import compilation

started = []
compilation.Popen = lambda command, **_: started.append(command)
os.sched_getaffinity = lambda process: {*range(int(sys.argv[1]))}
for _ in range(2):
    compilation.compile_on_two_cores()
import numba
assert not started
for function in (lambda x: x + 1, lambda x: x + 2):
    numba.njit(function)(1)
print(len(started))
"""


@pytest.mark.compiles
@pytest.mark.parametrize(("cores", "count"), [("2", 1), ("1", 0)])
def test_the_first_compilation_starts_it_where_there_are_two_cores(cores: str, count: int) -> None:
    done = subprocess.run([sys.executable, "-c", STARTS, cores], capture_output=True, text=True, cwd=Path(ROOT))
    assert done.stdout.split() == [str(count)], done.stderr
