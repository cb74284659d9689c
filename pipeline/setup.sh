#!/bin/sh
# Make .venv with the locked packages, and see to the system libraries that gmsh and VTK load.
# Needs a shell only. As root it installs by apt what is missing, else it prints the line to type; exit code 2.
set -eu
cd "$(dirname "$0")/.."

LIBRARIES="libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1 libegl1"
LOCK=requirements.lock
VENV=.venv
INSIDE=$VENV/bin/python
DONE=$VENV/.packages # exists while the packages are complete: says of which lock, and for which folder

say() { printf '%s\n' "$*" >&2; }
stop() { say "$@"; exit 2; }

# Foreign settings that would leak into the environment, and a cache only where one can be kept.
unset PYTHONPATH PYTHONHOME
export PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 UV_LINK_MODE="${UV_LINK_MODE:-copy}"
CACHE=${XDG_CACHE_HOME:-${HOME:+$HOME/.cache}}
if [ -z "$CACHE" ] || ! mkdir -p "$CACHE" 2>/dev/null || ! [ -w "$CACHE" ] || ! [ -O "$CACHE" ]; then
    export PIP_NO_CACHE_DIR=1 UV_NO_CACHE=1
fi

# --- system packages --------------------------------------------------------------------------------------------

absent() { # those of the named Debian packages that are not installed
    for package; do
        dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || printf '%s ' "$package"
    done
}

install() { # the named Debian packages
    packages=$(absent "$@")
    packages=${packages% }
    [ -n "$packages" ] || return 0
    if [ "$(id -u)" != 0 ]; then
        say "System packages are missing. Type this line, then the same make again:"
        stop "    sudo apt-get update && sudo apt-get install -y --no-install-recommends $packages"
    fi
    say "system packages: $packages"
    # shellcheck disable=SC2086  # a list of words
    if ! report=$(export DEBIAN_FRONTEND=noninteractive
        apt-get update -qq 2>&1
        apt-get install -y -qq --no-install-recommends $packages 2>&1); then
        stop "$report
apt-get could not install $packages: see above, and make sure that the network is there."
    fi
}

has_apt() { command -v apt-get >/dev/null 2>&1 && command -v dpkg-query >/dev/null 2>&1; }

# --- Python -----------------------------------------------------------------------------------------------------

recent() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

find_python() { # the first Python that is new enough, or nothing
    for candidate in ${PYTHON3:+"$PYTHON3"} python3 python3.13 python3.12 python3.11; do
        if command -v "$candidate" >/dev/null 2>&1 && recent "$candidate"; then
            printf '%s' "$candidate"
            return
        fi
    done
}

find_or_install_python() {
    PYTHON=$(find_python)
    if [ -z "$PYTHON" ] && has_apt && ! command -v python3 >/dev/null 2>&1; then
        # shellcheck disable=SC2086
        install python3 python3-venv $LIBRARIES
        PYTHON=$(find_python)
    fi
    if [ -z "$PYTHON" ]; then
        found=$(python3 -V 2>/dev/null || echo "no Python")
        stop "Python 3.11 or newer is needed and $found was found: install it (PYTHON3=/path/to/it make ... takes it" \
            "from anywhere), or install uv (https://docs.astral.sh/uv), which brings its own, and type make again."
    fi
    if ! "$PYTHON" -c 'import venv, ensurepip' 2>/dev/null; then
        has_apt || stop "$PYTHON lacks the modules venv and ensurepip: install them, or uv, and type make again."
        # shellcheck disable=SC2086
        install "${PYTHON##*/}-venv" $LIBRARIES
        "$PYTHON" -c 'import venv, ensurepip' 2>/dev/null ||
            stop "$PYTHON lacks the modules venv and ensurepip: install them, or uv, and type make again."
    fi
}

# --- environment ------------------------------------------------------------------------------------------------

usable() { # a whole environment of a Python that still exists, not a link to the system's own
    [ -f "$DONE" ] && "$INSIDE" -c 'import sys; sys.exit(sys.prefix == sys.base_prefix)' 2>/dev/null && recent "$INSIDE"
}

announce() { say "packages into $VENV: some 700 MB to download, 2.8 GB on disk, a few minutes"; }

by_uv() {
    announce
    if ! usable; then
        rm -rf "$VENV"
        PYTHON=$(find_python)
        # Without a Python on the system uv downloads one; where it cannot, the system's is installed.
        [ -n "$PYTHON" ] || uv venv -q --python 3.12 "$VENV" 2>/dev/null || find_or_install_python
        [ -z "$PYTHON" ] || uv venv -q --python "$PYTHON" "$VENV" || return
    fi
    rm -f "$DONE"
    uv pip install -q --python "$INSIDE" --only-binary :all: -r "$LOCK" &&
        uv pip install -q --python "$INSIDE" --no-deps -e .
}

by_pip() {
    if ! usable || ! "$INSIDE" -m pip -V >/dev/null 2>&1; then
        find_or_install_python
        announce
        rm -rf "$VENV"
        "$PYTHON" -m venv "$VENV"
    fi
    rm -f "$DONE"
    "$INSIDE" -m pip install -q --only-binary :all: -r "$LOCK" && "$INSIDE" -m pip install -q --no-deps -e .
}

wanted="$(cat "$LOCK" pyproject.toml | cksum) $(pwd -P)"
if ! usable || [ "$(cat "$DONE")" != "$wanted" ]; then
    if command -v uv >/dev/null 2>&1; then installer=by_uv; else installer=by_pip; fi
    $installer || stop "The packages could not be installed: see above, make sure that the network is there and the" \
        "disk not full, and type make again."
    printf '%s\n' "$wanted" >"$DONE"
fi

# --- what gmsh and VTK load -------------------------------------------------------------------------------------
# A missing library stops gmsh with an exception and VTK with a crash: try each in a process of its own.

gmsh_works() { "$INSIDE" -c 'import gmsh' >/dev/null 2>&1; }

pyvista_works() {
    "$INSIDE" -c 'from microslip.pictures import can_draw; raise SystemExit(can_draw() is not None)' >/dev/null 2>&1
}

# shellcheck disable=SC2086
if ! { gmsh_works && pyvista_works; } && has_apt; then install $LIBRARIES; fi
gmsh_works || stop "gmsh does not start, a system library is missing: $("$INSIDE" -c 'import gmsh' 2>&1 | tail -n 1)"
pyvista_works || say "warning: PyVista cannot draw on this machine; all else works, reports go without pictures of bodies"
rm -f "$VENV/.ready" # a copy of the environment may share the file with the one it was copied from
printf '%s\n' "$(pwd -P)" >"$VENV/.ready"
