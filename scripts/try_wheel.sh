#!/bin/sh
# Install the wheel built by `make dist` in a new environment in FOLDER, and try the commands there.
#   scripts/try_wheel.sh FOLDER [PYTHON]
set -eu

[ $# -ge 1 ] || {
    echo "usage: scripts/try_wheel.sh FOLDER [PYTHON]" >&2
    exit 2
}
root=$(cd "$(dirname "$0")/.." && pwd)
mkdir "$1"
cd "$1"
"${2:-python3}" -m venv venv
unset PYTHONPATH VIRTUAL_ENV
PATH="$PWD/venv/bin:$PATH"
python -m pip --disable-pip-version-check --quiet install --no-compile --constraint "$root/requirements.txt" "$root"/dist/*.whl
du -sh venv

try() {
    echo "$ $*"
    "$@"
}

try sarsim-episode --steps 2 --mission virtual --minutes 0.5 --out run
try sarsim-view --help >view.txt
timeout --preserve-status --signal INT 20 sarsim-view run --web | head -1
try sarsim-dataset --out data --scenes 1 --frames 3 --workers 1
try sarsim-export-dataset tum --data data --out tum
try sarsim-export-map run --out map.bt
try sarsim-map-recording data/scenes/00000.h5 --out mapped --labels rules --detector None
try sarsim-teleop --help >teleop.txt
try sarsim-validate-mission run/handed_in
try sarsim-score-mission run/handed_in --arena nist_6x4
echo "the wheel works"
