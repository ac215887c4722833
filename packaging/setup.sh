#!/bin/sh
# Make an environment: packaging/setup.sh PYTHON FOLDER EXTRA. Needs a Python from 3.11 on; says what is missing and how
# to get it. EXTRA names what the environment is for, in pyproject.toml.
set -eu
python=$1
venv=$2
extra=$3

# Debian packages: the libraries the window loads, on a screen and without one, and the virtual screen of one test
libraries="libgl1 libegl1 libxkbcommon0 libfontconfig1 libglib2.0-0 libdbus-1-3
    libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-render-util0 libxcb-shape0 libxcb-xkb1
    libxkbcommon-x11-0 xvfb xauth"

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "setup: $("$python" --version 2>&1) is too old; install Python 3.11 or newer and call make PYTHON=python3.11" >&2
    exit 1
}

missing=""
"$python" -c 'import ensurepip, venv' 2>/dev/null ||
    missing=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
if command -v dpkg-query >/dev/null; then
    for library in $libraries; do
        # newer Debian releases give some libraries the suffix t64
        dpkg-query -W -f '${Status}\n' "$library" "${library}t64" 2>/dev/null | grep -q '^install ok installed' ||
            missing="$missing $library"
    done
fi
if [ -n "$missing" ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "setup: installing$missing"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $missing >/dev/null
    else
        echo "setup: some Debian packages are missing; run this once, then call make again:" >&2
        echo "    sudo apt-get install -y$missing" >&2
        case "$missing" in *venv*) exit 1 ;; esac
    fi
fi

echo "setup: making the environment in $venv (a minute or two the first time)"
"$venv/bin/python" -m pip --version >/dev/null 2>&1 || "$python" -m venv "$venv"
# Python compiles what is used at its first use: all at once takes half a minute
"$venv/bin/python" -m pip install --no-compile --quiet --disable-pip-version-check -e ".[$extra]"
