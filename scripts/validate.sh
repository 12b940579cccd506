#!/usr/bin/env bash
# Holds the models against what they must reproduce: scripts/validate.sh NAME. Names and options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help validate "$@"
phil_environment run
exec python -m validate "$@"
