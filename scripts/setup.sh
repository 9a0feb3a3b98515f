#!/usr/bin/env bash
# Makes .venv ready for `make test` and `make bench`, from a machine with Python 3.11 and make.
# A second call finds its stamp and returns at once.
#
#   PYTHON=/path/to/python3.11   the interpreter to use
#   ARTGYM_NO_APT=1              install no system packages, even as root
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

VENV=.venv
LOG=$VENV/setup.log
STAMP=$VENV/setup.stamp
EXTRAS=train,baselines,rl,video,assets,mjcf,cluster,dev

say() { printf '[setup] %s\n' "$*"; }

fail() {
    printf '[setup] FAILED: %s\n' "$*" >&2
    exit 1
}

# Runs a command with its output in the log, and shows the end of it when the command fails.
logged() {
    printf '+ %s\n' "$*" >>"$LOG"
    if ! "$@" >>"$LOG" 2>&1; then
        printf '[setup] the last lines of %s:\n' "$LOG" >&2
        tail -n 25 "$LOG" >&2
        fail "$*"
    fi
}

is_python_311() {
    "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' >/dev/null 2>&1
}

# pyenv's shims exist for versions that are not active: only running one tells.
find_python() {
    local candidate
    if [ -n "${PYTHON:-}" ]; then
        is_python_311 "$PYTHON" || fail "PYTHON=$PYTHON is not a Python 3.11"
        command -v "$PYTHON"
        return
    fi
    for candidate in python3.11 python3 /usr/bin/python3.11 /usr/local/bin/python3.11; do
        if is_python_311 "$candidate"; then
            command -v "$candidate"
            return
        fi
    done
    fail "Python 3.11 is needed (3.12 and later are not tried) and was not found.
    Install it (Debian 12: apt-get install python3.11 python3.11-venv; elsewhere: pyenv install 3.11)
    or name it: make test PYTHON=/path/to/python3.11"
}

make_venv() {
    local python=$1
    # One that works is kept, and only what changed is installed; `make clean` removes it.
    if is_python_311 "$VENV/bin/python" && "$VENV/bin/python" -m pip --version >/dev/null 2>&1; then
        return
    fi
    if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
        # Debian and Ubuntu keep these in a package of their own.
        if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null && [ -z "${ARTGYM_NO_APT:-}" ]; then
            say "installing python3.11-venv"
            { apt-get update -q && apt-get install -y -q --no-install-recommends python3.11-venv; } \
                >/dev/null 2>&1 || true
        fi
        "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 ||
            fail "$python cannot make virtual environments. Install python3.11-venv as root:
    apt-get update && apt-get install -y python3.11-venv"
    fi
    rm -rf "$VENV"
    "$python" -m venv "$VENV" || fail "$python -m venv $VENV"
}

wanted_stamp() {
    # The folder counts: an editable installation points at it.
    { "$1" --version && pwd && cat pyproject.toml constraints.txt scripts/setup.sh; } | sha256sum
}

install_packages() {
    local python=$1 started=$SECONDS torch
    say "virtual environment of $("$python" --version) in $VENV"
    make_venv "$python"
    rm -f "$STAMP"
    : >"$LOG"
    torch=$(grep '^torch==' constraints.txt)
    local pip=("$VENV/bin/python" -m pip --disable-pip-version-check install --progress-bar off)
    # On its own and first, so that nothing that depends on it chooses another build.
    say "installing $torch"
    logged "${pip[@]}" "$torch" -c constraints.txt
    say "installing artgym[$EXTRAS] and what it needs (details in $LOG)"
    logged "${pip[@]}" -e ".[$EXTRAS]" -c constraints.txt
    say "packages ready after $((SECONDS - started)) s"
}

python=$(find_python) || exit 1

scripts/system_packages.sh "$python"

# The stamp is written last: a set-up that was interrupted starts again.
if [ "$(cat "$STAMP" 2>/dev/null)" != "$(wanted_stamp "$python")" ]; then
    install_packages "$python"
    wanted_stamp "$python" >"$STAMP"
fi
