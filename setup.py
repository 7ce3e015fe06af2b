"""Which packages are installed, for pyproject.toml cannot say that one of them lies elsewhere."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["pipeline*", "sarsim*"]), "sarsim.asset_files"],
    package_dir={"sarsim.asset_files": "assets"},
)
