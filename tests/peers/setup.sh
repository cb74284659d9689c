#!/bin/sh
# Make an environment of its own for every program that exports or answers are compared with: build/peers/<name> from <name>.txt beside.
# An argument names one of them. What cannot be installed is said and left out: its tests are then skipped; exit code 1.
set -u
cd "$(dirname "$0")/../.."
unset PYTHONPATH PYTHONHOME
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1

make_one() { # name
    place=build/peers/$1 list=tests/peers/$1.txt
    wanted="$(cksum <"$list") $(pwd -P)"
    [ "$(cat "$place/.ready" 2>/dev/null)" = "$wanted" ] && return 0
    rm -rf "$place"
    if command -v uv >/dev/null 2>&1; then
        uv venv -q --python .venv/bin/python "$place" &&
            uv pip install -q --python "$place/bin/python" --only-binary :all: --no-deps -r "$list" || return 1
    else
        .venv/bin/python -m venv "$place" &&
            "$place/bin/python" -m pip install -q --only-binary :all: --no-deps -r "$list" || return 1
    fi
    printf '%s\n' "$wanted" >"$place/.ready"
}

failed=0
for name in ${1:-pyharm exudyn fmpy pynastran tamaas}; do
    if make_one "$name"; then
        echo "$name: build/peers/$name"
    else
        rm -rf "build/peers/$name"
        echo "$name could not be installed: its tests are skipped" >&2
        failed=1
    fi
done
exit $failed
