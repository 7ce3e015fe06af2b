#!/bin/sh
# Make sarsim run on this machine: the system packages that it lacks, then .venv with the pinned Python packages.
set -eu

LIBRARIES="libegl1 libgl1 libgl1-mesa-dri libgomp1 libidn2-0 libusb-1.0-0" # rendering without a screen; Open3D
PYTHONS="python3.11 python3 python3.12 python3.13 python3.14"    # every pinned package has a build for 3.11 to 3.14

main() {
    cd "$(dirname "$0")/.."
    install_libraries
    make_venv
    install_python_packages
}

install_libraries() {
    if command -v dpkg-query >/dev/null; then
        # shellcheck disable=SC2046 # one word a package
        install_packages $(missing $LIBRARIES)
    else
        say "not Debian or Ubuntu; this machine needs what they call $LIBRARIES"
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
        command -v "$tool" >/dev/null || fail "there is no $tool to install $*"
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

# A Python that is there already comes before any that apt-get would bring; Ubuntu 22.04's own python3 is too old.
usable_python() {
    find_python && return
    for package in python3-venv python3.11-venv; do
        install_packages "$package" >&2
        find_python && return
    done
    fail "no Python from 3.11 to 3.14 that can make a virtual environment"
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

install_python_packages() {
    say "installing Python packages into .venv; the first time this takes some minutes and 4 to 8 GB"
    # torch comes with what its build for this machine needs; of all else requirements.txt holds the last detail.
    pip install --constraint requirements.txt torch
    pip install --no-deps --requirement requirements.txt
    pip install --no-deps --no-build-isolation --editable .
    # Functions that an earlier version compiled may name classes that are gone, and then numba fails to load them.
    find pipeline sarsim -name '*.nb[ic]' -delete
}

pip() {
    .venv/bin/python -m pip --disable-pip-version-check --quiet "$@"
}

say() {
    echo "setup: $*"
}

fail() {
    echo "setup: error: $*" >&2
    exit 1
}

main
