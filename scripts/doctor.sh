#!/usr/bin/env bash
# Looks at the machine: what stands against a ride in real time, and what to type about it. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help doctor "$@"
phil_environment run
exec python -m doctor "$@"
