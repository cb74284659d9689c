#!/bin/sh
# Make .venv with the locked packages, and see to the system libraries that gmsh and VTK load.
# Needs nothing but a shell; with root it installs what is missing by apt, else it prints the line to type.
set -eu

LIBRARIES="libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1 libegl1"
LOCK=requirements.lock
VENV=.venv

say() { printf '%s\n' "$*" >&2; }

install() { # install the named Debian packages, or say how
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        say "installing $*"
        export DEBIAN_FRONTEND=noninteractive
        # shellcheck disable=SC2068
        apt-get install -y -qq --no-install-recommends $@ >/dev/null 2>&1 ||
            { apt-get update -qq >/dev/null && apt-get install -y -qq --no-install-recommends $@ >/dev/null; }
    else
        say "missing system packages; type:"
        say "    sudo apt-get install -y $*"
        exit 2
    fi
}

python_ok() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

PYTHON=""
for candidate in "${PYTHON3:-python3}" python3.13 python3.12 python3.11; do
    if command -v "$candidate" >/dev/null 2>&1 && python_ok "$candidate"; then PYTHON=$candidate; break; fi
done
if command -v uv >/dev/null 2>&1; then
    [ -x "$VENV/bin/python" ] || uv venv -q ${PYTHON:+--python "$PYTHON"} "$VENV"
    uv pip install -q --python "$VENV/bin/python" -r "$LOCK"
    uv pip install -q --python "$VENV/bin/python" --no-deps -e .
else
    if [ -z "$PYTHON" ]; then
        install python3 python3-venv
        PYTHON=python3
        python_ok "$PYTHON" || { say "Python 3.11 or newer is needed; this system's is older (uv can bring one)"; exit 2; }
    fi
    "$PYTHON" -c 'import ensurepip' 2>/dev/null || install python3-venv
    [ -x "$VENV/bin/pip" ] || "$PYTHON" -m venv --clear "$VENV"
    "$VENV/bin/python" -m pip install -q --disable-pip-version-check -r "$LOCK"
    "$VENV/bin/python" -m pip install -q --disable-pip-version-check --no-deps -e .
fi

# A missing library stops gmsh with an exception and VTK with a crash: probe each in a process of its own.
works() {
    "$VENV/bin/python" -c 'import gmsh' >/dev/null 2>&1 &&
        VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow "$VENV/bin/python" -c '
import pyvista
p = pyvista.Plotter(off_screen=True, window_size=(32, 32))
p.add_mesh(pyvista.Sphere())
p.screenshot(return_img=True)' >/dev/null 2>&1
}
if ! works; then
    install $LIBRARIES
    works || { say "gmsh or PyVista still does not start; see: $VENV/bin/python -c 'import gmsh, pyvista'"; exit 2; }
fi
touch "$VENV/.ready"
