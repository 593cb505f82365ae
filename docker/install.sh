#!/bin/sh
# Installs vbus in two steps, so that what runs it needs no compiler.
#
#   install.sh wheels SOURCE WHEELS   build vbus and what it needs as wheels (needs gcc)
#   install.sh venv WHEELS VENV       install them, and nothing else, in a new environment
#
# VBUS_PURE=1 builds the interpreted core, 50 to 170 times slower in samples, without a compiler.
set -eu

usage() {
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
}

[ $# -eq 3 ] || usage

case $1 in
wheels)
    if [ "${VBUS_PURE:-0}" = 0 ]; then
        export VBUS_NEED_COMPILED=1
    fi
    python3 -m pip wheel --quiet --disable-pip-version-check --wheel-dir "$3" "$2[wave,metrics]"
    ;;
venv)
    python3 -m venv "$3"
    "$3/bin/python" -m pip install --quiet --disable-pip-version-check --no-cache-dir \
        --no-index --find-links "$2" "vbus[wave,metrics]"
    version=$("$3/bin/vbus" --version)
    echo "$version"
    if [ "${VBUS_PURE:-0}" = 0 ] && [ "${version#*compiled core}" = "$version" ]; then
        echo "install.sh: the core is not compiled; set VBUS_PURE=1 if that is meant" >&2
        exit 1
    fi
    ;;
*)
    usage
    ;;
esac
