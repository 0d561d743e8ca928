#!/bin/sh
# POV-Ray is what our pictures are checked against. Installs Debian's package when missing; where that can't be done,
# says so, and the tests that need it are skipped with that reason.
set -eu
command -v povray >/dev/null && exit 0
if command -v apt-get >/dev/null; then
    if [ "$(id -u)" = 0 ]; then
        apt-get update -qq && apt-get install -qq -y povray povray-includes >/dev/null && exit 0
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        sudo -n apt-get update -qq && sudo -n apt-get install -qq -y povray povray-includes >/dev/null && exit 0
    fi
fi
echo "POV-Ray isn't installed and can't be installed here: tests that compare with it will be skipped." >&2
echo "To run them too: sudo apt-get install povray povray-includes" >&2
