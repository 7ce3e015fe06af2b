#!/bin/sh
# Try the ranges of pyproject.toml: make a virtual environment of the lowest or the newest versions that they allow, and run tests
# in it. With TORCH=VERSION in the environment that torch is taken, such as one of which there is a build for CPUs.
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
