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


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that a wheel, built from an sdist of a copy of the checkout, is installed into."""
    copy, wheels, target = (tmp_path_factory.mktemp(name) for name in ("copy", "wheels", "target"))
    for name in ("pipeline", "sarsim", "assets"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", PROJECT["readme"], *PROJECT["license-files"]):
        shutil.copy(ROOT / name, copy)
    build = "from setuptools import build_meta; build_meta.build_sdist('dist')"
    subprocess.run([sys.executable, "-c", build], cwd=copy, check=True, stdout=subprocess.DEVNULL)
    pip("wheel", "--no-build-isolation", "--wheel-dir", wheels, *(copy / "dist").iterdir())
    pip("install", "--no-compile", "--target", target, *wheels.iterdir())
    return target


def pip(command: str, *args: object) -> None:
    """Run pip on this project alone."""
    flags = ["--quiet", "--no-deps", "--no-index", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", command, *flags, *map(str, args)], check=True)


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


def files(folder: Path) -> dict[Path, bytes]:
    """Contents by relative path."""
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_wheel_holds_every_asset(installed: Path) -> None:
    assets = files(ROOT / "assets")
    assert Path("arenas/nist_6x4.xml") in assets
    assert files(installed / "sarsim" / "asset_files") == assets


@pytest.mark.parametrize("package", ["pipeline", "sarsim"])
def test_wheel_holds_every_module(installed: Path, package: str) -> None:
    modules, found = ({p.relative_to(top) for p in (top / package).rglob("*.py")} for top in (ROOT, installed))
    assert Path(package, "__init__.py") in modules
    assert found == modules


@pytest.mark.parametrize("package", ["pipeline/rescue_report", "sarsim/dataset", "sarsim/commands/sweeps"])
def test_wheel_holds_every_template(installed: Path, package: str) -> None:
    templates = files(ROOT / package / "templates")
    assert templates
    assert files(installed / package / "templates") == templates


def test_wheel_holds_nothing_else_at_the_top(installed: Path) -> None:
    names = {p.name for p in installed.iterdir() if p.suffix != ".dist-info"}
    assert names <= {"pipeline", "sarsim", "bin"}


def test_installed_copy_opens_its_own_models(installed: Path) -> None:
    code = (
        "import mujoco, pipeline, sarsim\n"
        "from sarsim.assets import asset\n"
        "print(pipeline.__file__, sarsim.__file__, sep='\\n')\n"
        "for parts in [('arenas', 'nist_6x4.xml'), ('robots', 'pioneer3at', 'scene.xml')]:\n"
        "    mujoco.MjModel.from_xml_path(str(asset(*parts)))\n"
        "    print(asset(*parts))\n"
    )
    paths = run_installed(installed, code)
    assert len(paths) == 4
    assert all(Path(path).is_relative_to(installed) for path in paths)


def test_an_installed_command_runs(installed: Path) -> None:
    code = "import sys; sys.argv[1:] = ['--version']; from sarsim.commands.run_episode import main; main()"
    assert run_installed(installed, code) == [f"sarsim {PROJECT['version']}"]


def test_installed_commands_are_there(installed: Path) -> None:
    targets = [target.split(":") for target in PROJECT["scripts"].values()]
    commands = [path for path in (ROOT / "sarsim" / "commands").glob("*.py") if "def main()" in path.read_text()]
    assert sorted(module for module, _ in targets) == sorted(f"sarsim.commands.{path.stem}" for path in commands)
    code = "from importlib import import_module\n"
    for module, function in targets:
        code += f"m = import_module({module!r}); print(callable(m.{function}), m.__file__)\n"
    for line, (module, _) in zip(run_installed(installed, code), targets, strict=True):
        is_callable, path = line.split(" ", 1)
        assert is_callable == "True", module
        assert Path(path).is_relative_to(installed)


def pins(lines: list[str]) -> dict[str, str]:
    """Version by name, of lines like ``numpy==2.4.6``."""
    pairs = [re.match(r"([\w.-]+)==([\w.]+)", line) for line in lines]
    return {canonicalize_name(pair[1]): pair[2] for pair in pairs if pair}


LOCKED = pins((ROOT / "requirements.txt").read_text().splitlines())


def test_requirements_are_what_the_project_begins_with() -> None:
    asked = [Requirement(line) for line in PROJECT["dependencies"] + PROJECT["optional-dependencies"]["dev"]]
    for need in asked:
        pinned = LOCKED[canonicalize_name(need.name)]
        assert need.specifier.contains(pinned), need
        lowest = next(s.version for s in need.specifier if s.operator in (">=", "=="))
        assert pinned.startswith(lowest), f"{need}: {pinned} is what is tested"
    for line in PROJECT["dependencies"]:
        assert re.search("==|<", line), f"{line}: the next major version may break"


def test_the_changes_of_this_version_are_reported() -> None:
    assert f"\n## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text()


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
