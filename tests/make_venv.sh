#!/bin/sh
# Makes .venv with the given Python (3.11 or newer). Debian splits `venv` off into a package of its own: where it is
# missing, it is installed (root) or asked for (others).
set -eu
python=${1:-python3}
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    echo "plsys needs Python 3.11 or newer; '$python' isn't. Set PYTHON=/path/to/python3." >&2
    exit 2
fi
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq && apt-get install -qq -y python3-venv >/dev/null
    elif "$python" -m virtualenv --version >/dev/null 2>&1; then
        exec "$python" -m virtualenv -q .venv
    else
        echo "Python's venv module is missing. Install it with: sudo apt-get install python3-venv" >&2
        exit 2
    fi
fi
"$python" -m venv .venv
