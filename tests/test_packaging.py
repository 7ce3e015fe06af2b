"""An sdist and the wheel made of it carry everything that a copy outside the checkout needs."""

import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


DATA = ("py.typed", "kernels.json")

BUILD = """
import os, shutil, sys
from setuptools import build_meta
copy, target = sys.argv[1:]
os.chdir(copy)
shutil.unpack_archive(os.path.join("dist", build_meta.build_sdist("dist")), "unpacked")
os.chdir(os.path.join("unpacked", os.listdir("unpacked")[0]))
shutil.unpack_archive(os.path.join("dist", build_meta.build_wheel("dist")), target, "zip")
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that a wheel, built from an sdist of a copy of the checkout, is unpacked into."""
    copy, target = (tmp_path_factory.mktemp(name) for name in ("copy", "target"))
    copy_of_checkout(copy)
    subprocess.run([sys.executable, "-c", BUILD, copy, target], check=True, stdout=subprocess.DEVNULL)
    return target


def copy_of_checkout(copy: Path) -> None:
    for name in ("pipeline", "sarsim", "assets"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", PROJECT["readme"], *PROJECT["license-files"]):
        shutil.copy(ROOT / name, copy)


def run_installed(installed: Path, code: str) -> list[str]:
    """Lines that ``code`` prints where only the installed copy is at hand."""
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=installed.parent,
        env={"PYTHONPATH": str(installed), "HOME": str(installed.parent)},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    return result.stdout.splitlines()


def files(top: Path, *folders: str) -> dict[Path, bytes]:
    """Contents by the path relative to ``top``, of files in folders of it."""
    found = (p for folder in folders for p in (top / folder).rglob("*") if p.is_file() and p.suffix != ".nbi")
    return {p.relative_to(top): p.read_bytes() for p in found}


def test_the_wheel_holds_every_module_asset_and_template_and_nothing_else(installed: Path) -> None:
    source = files(ROOT, "pipeline", "sarsim").items()
    expected = {path: text for path, text in source if path.suffix == ".py" or path.name in DATA}
    for folder in ("pipeline/rescue_report", "sarsim/dataset", "sarsim/commands/sweeps"):
        templates = files(ROOT, f"{folder}/templates")
        assert templates
        expected |= templates
    expected |= {Path("sarsim/asset_files", path): text for path, text in files(ROOT / "assets", ".").items()}
    assert expected.keys() >= {Path("pipeline/__init__.py"), Path("sarsim/asset_files/arenas/nist_6x4.xml")}
    found = files(installed, ".")
    assert {path: text for path, text in found.items() if ".dist-info" not in path.parts[0]} == expected


def test_an_installed_copy_opens_its_own_models_and_has_its_commands(installed: Path) -> None:
    targets = [target.split(":") for target in PROJECT["scripts"].values()]
    package = ROOT / "sarsim"
    sources = [package / "__main__.py", *(package / "commands").glob("*.py"), *(package / "plugins").rglob("*.py")]
    commands = [path.relative_to(ROOT).with_suffix("") for path in sources if "def main()" in path.read_text()]
    assert sorted(module for module, _ in targets) == sorted(".".join(path.parts) for path in commands)
    code = (
        "import mujoco, sys\n"
        "from importlib import import_module\n"
        "from sarsim.assets import asset\n"
        "for parts in [('arenas', 'nist_6x4.xml'), ('robots', 'pioneer3at', 'scene.xml')]:\n"
        "    mujoco.MjModel.from_xml_path(str(asset(*parts)))\n"
        "    print(asset(*parts))\n"
        f"for module, function in {targets}:\n"
        "    assert callable(getattr(import_module(module), function)), module\n"
        "    print(import_module(module).__file__)\n"
        "sys.argv[1:] = ['--version']\n"
        "import_module('sarsim.commands.run_episode').main()\n"
    )
    *paths, version = run_installed(installed, code)
    assert len(paths) == 2 + len(targets)
    assert all(Path(path).is_relative_to(installed) for path in paths)
    assert version == f"sarsim {PROJECT['version']}"


def pins(lines: list[str]) -> dict[str, str]:
    """Version by name, of lines like ``numpy==2.4.6``."""
    pairs = [re.match(r"([\w.-]+)==([\w.]+)", line) for line in lines]
    return {canonicalize_name(pair[1]): pair[2] for pair in pairs if pair}


EPISODE, DEVELOPMENT = (
    pins((ROOT / name).read_text().splitlines()) for name in ("requirements.txt", "requirements-dev.txt")
)
LOCKED = EPISODE | DEVELOPMENT


BEGINNING = PROJECT["dependencies"] + PROJECT["optional-dependencies"]["bags"]
"""What make installs."""


def test_requirements_are_what_the_project_begins_with() -> None:
    asked = [Requirement(line) for line in BEGINNING + PROJECT["optional-dependencies"]["dev"]]
    for need in asked:
        pinned = LOCKED[canonicalize_name(need.name)]
        assert need.specifier.contains(pinned), need
        lowest = next(s.version for s in need.specifier if s.operator in (">=", "=="))
        assert pinned.startswith(lowest), f"{need}: {pinned} is what is tested"
    for line in BEGINNING:
        assert re.search("==|<", line), f"{line}: the next major version may break"


def test_requirements_hold_what_they_need() -> None:
    if not all(is_met(Requirement(f"{package}=={pin}")) for package, pin in LOCKED.items() if package != "labmaze"):
        pytest.skip("this environment was not made of requirements.txt")
    unmet = [f"{package}: {need}" for package in LOCKED for need in needs(package) if not is_met(need)]
    assert not unmet


def needs(package: str) -> list[Requirement]:
    """What a package needs on this machine; labmaze is left out, for it has no build for every Python."""
    found = [] if package == "labmaze" else [Requirement(line) for line in requires(package) or []]
    return [n for n in found if n.name != "labmaze" and (not n.marker or n.marker.evaluate({"extra": ""}))]


def is_met(need: Requirement) -> bool:
    """Whether a fitting version is installed."""
    try:
        return need.specifier.contains(version(need.name), prereleases=True)
    except PackageNotFoundError:
        return False


WITHOUT = """
import sys
from importlib import import_module
from importlib.metadata import packages_distributions

development, modules = (set(words.split()) for words in sys.argv[1:])
for module, owners in packages_distributions().items():
    if {owner.lower().replace("_", "-") for owner in owners} <= development:
        sys.modules[module] = None
for name in modules:
    import_module(name)
"""
"""Imports modules where the packages of some distributions are missing."""


def test_commands_need_no_package_that_only_an_extra_brings() -> None:
    paths = [
        path.relative_to(ROOT).with_suffix("")
        for path in (ROOT / "sarsim").rglob("[!_]*.py")
        if path.parent.name != "tasks"  # which the extra ``rl`` is for
    ]
    names = [".".join(path.parts) for path in paths]
    of_ros = [name for name in names if "ros" in name.split(".")]  # which the extra ``bags`` is for
    others = [name for name in names if name not in of_ros]
    assert "sarsim.episode" in others and "sarsim.commands.recorded_drive" in others and of_ros
    for modules, missing in ((others, [*DEVELOPMENT, "rosbags"]), (of_ros, DEVELOPMENT)):
        words = [" ".join(missing), " ".join(modules)]
        done = subprocess.run([sys.executable, "-c", WITHOUT, *words], capture_output=True, text=True, cwd=ROOT)
        assert done.returncode == 0, done.stderr


def test_the_two_files_of_requirements_share_no_package() -> None:
    assert EPISODE.keys().isdisjoint(DEVELOPMENT)


COMMANDS = sorted(path for path in (ROOT / "scripts").glob("[!_]*.py") if path.stem != "release")
"""All scripts but the one that needs no environment."""


@pytest.mark.parametrize("script", COMMANDS, ids=lambda path: path.stem)
def test_a_script_outside_the_environment_says_how_to_enter_it(script: Path) -> None:
    outside = [sys.executable, "-E", "-S", script, "--help"]  # without any installed package
    done = subprocess.run(outside, capture_output=True, text=True)
    assert done.returncode and not done.stdout
    (line,) = done.stderr.splitlines()
    assert ".venv/bin/activate" in line


EDITABLE = """
import os, shutil, sys
from setuptools import build_meta
copy, target = sys.argv[1:]
os.chdir(copy)
shutil.unpack_archive(os.path.join("dist", build_meta.build_editable("dist")), target, "zip")
"""


def test_an_editable_checkout_called_sarsim_is_imported_from_beside_it(tmp_path: Path) -> None:
    """Python finds the folder ``sarsim`` in the current one first, but that is the checkout, not the package."""
    checkout, target = tmp_path / "sarsim", tmp_path / "site"
    copy_of_checkout(checkout)
    subprocess.run([sys.executable, "-c", EDITABLE, checkout, target], check=True, stdout=subprocess.DEVNULL)
    code = f"import site; site.addsitedir({str(target)!r}); from sarsim.assets import asset; print(asset().is_dir())"
    clean = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {code}"]
    assert subprocess.check_output(clean, cwd=tmp_path, env={"HOME": str(tmp_path)}, text=True) == "True\n"
