#!/bin/sh
# Install what sarsim needs: missing system packages, then the pinned Python packages in .venv.
#   scripts/setup.sh        installs what episodes and the other commands need
#   scripts/setup.sh dev    installs what tests, style checks, benchmarks and Ray need in addition
set -eu

LIBRARIES="libegl1 libgl1 libgl1-mesa-dri libgomp1 libidn2-0 libusb-1.0-0" # rendering without a screen; Open3D
TORCH_FOR_CPUS=https://download.pytorch.org/whl/cpu
PYTHONS="python3.11 python3 python3.12 python3.13 python3.14"    # every pinned package has builds for 3.11 to 3.14

main() {
    cd "$(dirname "$0")/.."
    case "${1:-}" in
    "") install_episode ;;
    dev) install_development ;;
    *) fail "unknown argument '$1'; usage: scripts/setup.sh [dev]" ;;
    esac
}

install_episode() {
    say "an episode needs $(count requirements.txt) Python packages in .venv: about 1.2 GB to download, 3.6 GB on disk"
    install_libraries
    make_venv
    say "installing the Python packages takes a few minutes"
    install_python_packages
    pip install --no-deps --no-build-isolation --editable .
    compile_imports
    # Functions compiled by an earlier version may refer to classes that no longer exist; numba then fails to load them.
    find pipeline sarsim -name '*.nb[ic]' -delete
}

install_development() {
    say "tests and benchmarks need $(count requirements-dev.txt) more packages: about 0.2 GB to download, 0.6 GB on disk"
    pip install --no-deps --requirement requirements-dev.txt
}

# The number of packages in a requirements file.
count() {
    grep -c '^[^#]*==' "$1"
}

install_libraries() {
    if command -v dpkg-query >/dev/null; then
        # shellcheck disable=SC2046 # each word is one package
        install_packages $(missing $LIBRARIES)
    else
        say "dpkg-query is missing; install your system's equivalents of these Debian packages: $LIBRARIES"
    fi
}

missing() {
    for package; do
        case "$(dpkg-query --show --showformat='${Status}' "$package" 2>/dev/null)" in
        *" installed") ;;
        *) echo "$package" ;;
        esac
    done
}

install_packages() {
    [ $# -gt 0 ] || return 0
    if [ "$(id -u)" -eq 0 ]; then as_root=; else as_root=sudo; fi
    for tool in apt-get $as_root; do
        command -v "$tool" >/dev/null || fail "$tool is missing; install $* yourself, then repeat the command"
    done
    say "installing $* with apt-get"
    $as_root apt-get -qq -o DPkg::Lock::Timeout=300 update
    $as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get -qq -o DPkg::Lock::Timeout=300 install --yes --no-install-recommends "$@" >/dev/null
}

make_venv() {
    if ! .venv/bin/python -c 'import pip' 2>/dev/null; then
        python=$(usable_python)
        "$python" -m venv --clear .venv
    fi
}

# Use an installed Python if possible; otherwise, install one with apt-get. Ubuntu 22.04's own python3 is too old.
usable_python() {
    find_python && return
    for package in python3-venv python3.11-venv; do
        install_packages "$package" >&2
        find_python && return
    done
    fail "found no Python 3.11 to 3.14 with the modules venv and ensurepip; install one, then repeat the command"
}

find_python() {
    for name in $PYTHONS; do
        if usable "$name"; then
            command -v "$name"
            return
        fi
    done
    return 1
}

usable() {
    "$1" -c 'import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null
}

# Install torch in parallel with all other packages, because pip uses only one core. Then install torch's dependencies:
# builds for GPUs may have more than the pinned ones.
install_python_packages() {
    others=.venv/requirements-but-torch.txt
    grep -v '^torch==' requirements.txt >"$others"
    install_torch --no-deps &
    torch=$!
    install_pinned "$others" || {
        wait
        exit 1
    }
    wait "$torch"
    install_torch
}

# On Linux, torch from PyPI includes 3 GB of CUDA libraries, which are useless without a GPU. PyTorch's own index
# offers a build without them.
install_torch() {
    if [ "$(uname)" = Linux ] && ! command -v nvidia-smi >/dev/null && reachable "$TORCH_FOR_CPUS/torch/"; then
        pip install --no-compile --constraint requirements.txt --extra-index-url "$TORCH_FOR_CPUS" "$@" torch
    else
        pip install --no-compile --constraint requirements.txt "$@" torch
    fi
}

reachable() {
    .venv/bin/python -c 'import sys, urllib.request; urllib.request.urlopen(sys.argv[1], timeout=5)' "$1" 2>/dev/null
}

# The file lists all dependencies, so pip need not resolve them.
install_pinned() {
    pip install --no-compile --no-deps --requirement "$1"
}

pip() {
    .venv/bin/python -m pip --disable-pip-version-check --quiet "$@"
}

# Compile the modules that the commands import to bytecode, even if Python is configured to write none. pip would compile
# ten times as many modules, which would take a minute and 0.4 GB. Imports may fail, for example without OpenGL; the
# command that needs the module reports this later.
compile_imports() {
    PYTHONDONTWRITEBYTECODE='' .venv/bin/python -c \
        'import open3d, rerun, torch, sarsim.dataset.generate, sarsim.episode, sarsim.teleoperation' 2>/dev/null || true
}

say() {
    echo "setup: $*"
}

fail() {
    echo "setup: error: $*" >&2
    exit 1
}

main "$@"
