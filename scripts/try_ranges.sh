#!/bin/sh
# Test the version ranges in pyproject.toml: create a virtual environment with the lowest or the newest versions that
# they allow, and run tests in it. The environment variable TORCH=VERSION selects another version of torch, for example
# one that has a build for CPUs.
#   scripts/try_ranges.sh lowest|newest PYTHON FOLDER [PYTEST ARGUMENTS …]
set -eu

case "${1:-}" in
lowest) resolution=lowest-direct ;;
newest) resolution=highest ;;
*)
    echo "usage: scripts/try_ranges.sh lowest|newest PYTHON FOLDER [PYTEST ARGUMENTS …]" >&2
    exit 2
    ;;
esac
cd "$(dirname "$0")/.."
"$2" -m venv "$3"
python="$3/bin/python"

install() {
    "$python" -m pip --disable-pip-version-check --quiet install "$@"
}

install uv
"$3/bin/uv" pip compile --quiet --resolution "$resolution" --python "$python" --no-header --no-annotate \
    --output-file "$3/pins.txt" pyproject.toml
[ -z "${TORCH:-}" ] || sed -i "s/^torch==.*/torch==$TORCH/" "$3/pins.txt"
install --constraint "$3/pins.txt" torch
"$3/bin/uv" pip install --quiet --python "$python" --constraint "$3/pins.txt" --editable '.[dev]'
shift 3
"$python" -m pytest "$@"
