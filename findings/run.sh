#!/usr/bin/env bash
# Runs the findings named (with or without .sh), or all of them; exit 1 if one no longer behaves as it states.
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if [ $# -eq 0 ]; then
    for script in "$here"/*.sh; do
        name=$(basename "$script" .sh)
        [ "$name" = run ] || set -- "$@" "$name"
    done
fi
failed=0
for name in "$@"; do
    script="$here/$(basename "$name" .sh).sh"
    if [ ! -f "$script" ] || [ "$script" = "$here/run.sh" ]; then
        echo "$name: no such finding in $here" >&2
        exit 2
    fi
    echo "== $(basename "$script" .sh)"
    bash "$script"
    case $? in
    0) echo "-> as stated" ;;
    2) echo "-> NOT RUN: its packages could not be installed" && failed=1 ;;
    *) echo "-> CHANGED: no longer as its head states" && failed=1 ;;
    esac
done
exit $failed
