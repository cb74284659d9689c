#!/bin/sh
# Wheel and sdist, checked: metadata, then each installed in clean environments with no extra, with [solve] and with
# [all], which read the sample's modal file and solve it. make release-check; products in dist/.
set -eu
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

needs_index() { # a step that downloads
    "$@" >"$work/log" 2>&1 && return
    tail -5 "$work/log"
    echo "release-check: '$*' failed. It takes packages from the index that pip is set to: is the network there? Nothing was published." >&2
    exit 1
}

echo "== build"
rm -rf dist
needs_index "$python" -m venv "$work/build"
needs_index "$work/build/bin/pip" install build twine
needs_index "$work/build/bin/python" -m build --outdir dist .
echo "== twine check"
"$work/build/bin/twine" check --strict dist/*

wheel=$(ls "$PWD"/dist/*.whl)
sdist=$(ls "$PWD"/dist/*.tar.gz)
sample='import microslip, pathlib; print(pathlib.Path(microslip.__file__).parent / "samples" / "basis.h5")'
try() { # name, what is installed, what is typed there
    echo "== $1"
    needs_index "$python" -m venv "$work/$1"
    needs_index "$work/$1/bin/pip" install "$2"
    mkdir "$work/$1/try"
    (cd "$work/$1/try" && PATH="$work/$1/bin:$PATH" sh -eu -c "$3") >"$work/said" 2>&1 || {
        tail -20 "$work/said"
        echo "release-check: '$3' failed in an environment with $1" >&2
        exit 1
    }
    tail -1 "$work/said"
    rm -rf "${work:?}/$1"
}
few="--set sweep.points=12 --set sweep.patience=0 --set sweep.normal_forces=[20.0]"
try base "$wheel" "file=\$(python -c '$sample'); microslip check \"\$file\""
try sdist "$sdist" "file=\$(python -c '$sample'); microslip check \"\$file\""
try solve "${wheel}[solve]" "microslip respond sample $few"
try all "${wheel}[all]" "microslip init blade && microslip modes blade --set mesh.size=24 --set modes.count=4 && microslip respond sample $few"
echo "release-check: $(basename "$wheel") and $(basename "$sdist") are good"
