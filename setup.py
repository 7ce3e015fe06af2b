"""Which packages are installed, and how; pyproject.toml cannot say either."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["pipeline*", "sarsim*"]), "sarsim.asset_files"],
    package_dir={"sarsim.asset_files": "assets"},
    # An editable install puts the checkout on sys.path. With setuptools' import hook instead, Python would take a
    # checkout called sarsim in the current folder for a namespace package of that name.
    options={"editable_wheel": {"mode": "compat"}},
)
