#!/usr/bin/env bash
# Installs the shared libraries and the Vulkan driver that pictures need, where they are missing.
# Which ones, and whether they are missing, artgym/sim/vulkan.py knows. Without root or apt it says
# what to install and returns 0: everything but pictures works without them.
#
#   usage: system_packages.sh [python]     ARTGYM_NO_APT=1 installs nothing
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

PYTHON=${1:-python3}
BACKPORTS_LIST=/etc/apt/sources.list.d/artgym-backports.list
LOG=$(mktemp)
trap 'rm -f "$LOG"' EXIT

say() { printf '[setup] %s\n' "$*"; }
# Drivers that crash must not stop the set-up.
vulkan() { "$PYTHON" artgym/sim/vulkan.py "$@" 2>/dev/null; }
explain() { say "pictures cannot be rendered here, and tests that need them will be skipped: $(vulkan --remedy || true)"; }

apt() {
    DEBIAN_FRONTEND=noninteractive apt-get -q -o Acquire::Retries=2 -o Acquire::http::Timeout=30 "$@" >>"$LOG" 2>&1
}

# The machine's own Debian mirror carries the backports too: take its address and its key from
# what apt is already configured with. Prints one line for sources.list.d.
backports_source() {
    local uri entry file key
    read -r uri entry < <(
        apt-get indextargets --format '$(CODENAME) $(COMPONENT) $(REPO_URI) $(SOURCESENTRY)' 'Created-By: Packages' |
            awk '$1 == "bookworm" && $2 == "main" { print $3, $4; exit }'
    ) || return 1
    file=${entry%:*}
    key=$(sed -nE 's/.*[Ss]igned-[Bb]y[:=][[:space:]]*([^] ]+).*/\1/p' "$file" | head -n 1)
    printf 'deb [signed-by=%s] %s bookworm-backports main\n' \
        "${key:-/usr/share/keyrings/debian-archive-keyring.gpg}" "$uri"
}

has_backports() {
    apt-get indextargets --format '$(CODENAME)' 'Created-By: Packages' | grep -qx bookworm-backports
}

install_with_apt() {
    local suite=$1 libraries driver packages target=()
    packages=$(vulkan --packages || true)
    driver=${packages##* }
    libraries=${packages% *}
    apt update || return 1
    if [ "$suite" = bookworm-backports ]; then
        if ! has_backports; then
            backports_source >"$BACKPORTS_LIST" || return 1
            if ! apt update; then
                # Left behind, it would break every later `apt-get update`.
                rm -f "$BACKPORTS_LIST"
                return 1
            fi
        fi
        target=(-t bookworm-backports)
    fi
    # shellcheck disable=SC2086  # a list of package names
    apt install -y --no-install-recommends $libraries || return 1
    apt install -y --no-install-recommends "${target[@]}" "$driver"
}

if vulkan >/dev/null; then
    exit 0
fi
suite=$(vulkan --suite || true)
if [ -n "${ARTGYM_NO_APT:-}" ] || [ "$(id -u)" != 0 ] || [ "${suite:-none}" = none ] ||
    ! command -v apt-get >/dev/null; then
    explain
    exit 0
fi
say "installing the Vulkan driver and libraries (apt, $suite packages)"
if ! install_with_apt "$suite"; then
    tail -n 15 "$LOG" >&2
    say "apt failed; see the lines above"
fi
vulkan >/dev/null || explain
