#!/usr/bin/env bash
# Damages every kind of file that is read here and looks at what comes of it. All options: --help.
set -u
. "$(dirname "${BASH_SOURCE[0]}")/lib/environment.sh"
phil_help fuzz "$@"
phil_environment test
exec python -m fuzz "$@"
