#!/bin/sh
# Make the environment: packaging/setup.sh PYTHON FOLDER. Needs a Python from 3.11 on; says what is missing and how to get it.
set -eu
python=$1
venv=$2

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "setup: $("$python" --version 2>&1) is too old; install Python 3.11 or newer and call make PYTHON=python3.11" >&2
    exit 1
}

"$python" -c 'import ensurepip, venv' 2>/dev/null || {
    package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    command="apt-get install -y $package"
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "setup: installing $package"
        apt-get update -qq && DEBIAN_FRONTEND=noninteractive $command >/dev/null
    else
        echo "setup: Python has no venv module; run: sudo $command" >&2
        exit 1
    fi
}

echo "setup: making the environment in $venv (about a minute the first time)"
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[dev]'
