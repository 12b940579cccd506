# Sets up what is missing, builds what is stale, and puts both into this shell. Sourced by the scripts beside it:
#     . "$(dirname "$0")/lib/environment.sh" && phil_environment run      (or: test)
# Two cases:
#   - a ROS 2 Jazzy is sourced: a virtual environment that sees it and adds only what it does not have (.venv-ros)
#   - else: a virtual environment with ROS 2 Jazzy from wheels (.venv)
# Both are made once and again only when pyproject.toml or the Python version changes.

PHIL_ROOT="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"

phil_say() { printf '%s\n' "$*" >&2; }

phil_fail() { phil_say "error: $*"; exit 3; }

# Answers --help at once, before anything is set up: phil_help MODULE ARGUMENTS...
phil_help() {
  local module="$1" argument
  shift
  for argument in "$@"; do
    case "$argument" in
      -h | --help)
        PYTHONPATH="$PHIL_ROOT/scripts:$PHIL_ROOT/interfaces/phil_base:$PHIL_ROOT/energy_monitor" \
          "${PHIL_PYTHON:-python3}" -m "$module" --help 2>/dev/null && exit 0
        ;;
    esac
  done
}

# Debian and Ubuntu packages beyond a bare system; names the line to type.
phil_check_system() {
  local missing=()
  command -v "$PHIL_PYTHON" >/dev/null || missing+=(python3)
  command -v gcc >/dev/null || missing+=(gcc)
  command -v g++ >/dev/null || missing+=(g++)
  command -v cmake >/dev/null || missing+=(cmake)
  command -v make >/dev/null || missing+=(make)
  if command -v "$PHIL_PYTHON" >/dev/null; then
    "$PHIL_PYTHON" -c 'import venv, ensurepip' 2>/dev/null || missing+=(python3-venv)
    local header
    header="$("$PHIL_PYTHON" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h"
    [ -f "$header" ] || missing+=(python3-dev)
  fi
  if [ "${#missing[@]}" -gt 0 ]; then
    phil_say "These Debian packages are missing. Type:"
    phil_say "    sudo apt-get install ${missing[*]}"
    exit 3
  fi
  "$PHIL_PYTHON" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' ||
    phil_fail "Python 3.10 to 3.13 is needed, $PHIL_PYTHON is $("$PHIL_PYTHON" -V 2>&1); set PHIL_PYTHON to another one"
}

# CMake, in the message generator of ROS 2, takes a name only up to a byte that is no ASCII; others are separators of a
# path, a list or a shell. It would say so only after two minutes, and not clearly.
phil_check_path() {
  local LC_ALL=C
  case "$PHIL_ROOT" in
    *[![:print:]]* | *[\;:\"\'\`\$\&\|\(\)\<\>\*\?\#\\]*)
      phil_fail "the path '$PHIL_ROOT' has a letter beyond ASCII, or one of ; : \" ' \` \$ & | ( ) < > * ? # \\, on which the build of ROS 2 messages fails: move the folder"
      ;;
  esac
}

# Group names of pyproject.toml that are installed for a purpose (run or test).
phil_groups() {
  local groups=(build run)
  [ "$PHIL_ROS" = wheels ] && groups=(ros "${groups[@]}")
  [ "$1" = test ] && groups+=(test)
  printf '%s\n' "${groups[@]}"
}

# What an installation depends on: made again when it changes.
phil_wanted() {
  cat "$PHIL_ROOT/pyproject.toml" <("$PHIL_PYTHON" -V 2>&1; echo "$PHIL_ROS") | sha256sum
}

phil_install() {
  local purpose="$1" stamp wanted
  stamp="$PHIL_VENV/.phil-$purpose"
  wanted="$(phil_wanted)"
  # What the tests need includes what a ride needs.
  local done
  for done in "$stamp" "$PHIL_VENV/.phil-test"; do
    [ -f "$done" ] && [ "$(<"$done")" = "$wanted" ] && return
  done
  phil_check_system
  if [ ! -x "$PHIL_VENV/bin/python" ]; then
    phil_say "making $PHIL_VENV ($("$PHIL_PYTHON" -V 2>&1), ROS 2 from $PHIL_ROS)"
    local see=()
    [ "$PHIL_ROS" = sourced ] && see=(--system-site-packages)
    "$PHIL_PYTHON" -m venv "${see[@]}" "$PHIL_VENV" || phil_fail "no virtual environment at $PHIL_VENV"
    touch "$PHIL_VENV/COLCON_IGNORE" # colcon would take the wheels' package.xml files for packages to build
  fi
  phil_say "installing Python packages for: $purpose (a minute or two the first time)"
  local python="$PHIL_VENV/bin/python" log="$PHIL_VENV/.phil-pip.txt" arguments=() constraint
  "$python" -m pip install --disable-pip-version-check --upgrade 'pip>=25.1' >"$log" 2>&1 ||
    { tail -n 20 "$log" >&2; phil_fail "pip cannot be updated; all of it is in $log"; }
  while read -r group; do arguments+=(--group "$group"); done < <(phil_groups "$purpose")
  constraint="$PHIL_VENV/.phil-constraints"
  : >"$constraint"
  # The message code of a sourced ROS 2 was compiled for the numpy of its system: keep that one.
  [ "$PHIL_ROS" = sourced ] &&
    "$PHIL_PYTHON" -c 'import numpy; print(f"numpy=={numpy.__version__}")' >"$constraint" 2>/dev/null
  (cd "$PHIL_ROOT" && "$python" -m pip install --disable-pip-version-check -c "$constraint" "${arguments[@]}") >>"$log" 2>&1 ||
    { tail -n 20 "$log" >&2; phil_fail "the Python packages could not be installed; all of it is in $log"; }
  printf '%s' "$wanted" >"$stamp"
}

# Installs a group of packages that nothing depends on, into the environment that is set up; goes on without them.
phil_optional() {
  local group="$1" log="$PHIL_VENV/.phil-pip-$1.txt" wanted stamp="$PHIL_VENV/.phil-$1"
  wanted="$(phil_wanted)"
  [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ] && return
  phil_say "installing optional Python packages: $group"
  if (cd "$PHIL_ROOT" && "$PHIL_VENV/bin/python" -m pip install --disable-pip-version-check --retries 1 --only-binary=:all: \
    -c "$PHIL_VENV/.phil-constraints" --group "$group") >"$log" 2>&1; then
    printf '%s' "$wanted" >"$stamp"
  else
    phil_say "they could not be installed (all of it is in $log); going on without them"
  fi
}

# A digest of all that goes into the build of packages and comes out of it: the sources, what is installed (somebody may
# have built in between), the Python version, where ROS 2 comes from.
phil_digest() {
  (
    cd "$PHIL_ROOT" || exit
    find "$@" -type f -not -name '*.pyc' -not -path '*/__pycache__/*' -not -path '*/test/*' -print0 2>/dev/null | LC_ALL=C sort -z | xargs -0 sha256sum
    "$PHIL_VENV/bin/python" -V
    echo "$PHIL_ROS $PHIL_ROOT"
  ) | sha256sum
}

# The same of names, sizes and times, at a tenth of the cost. A file whose content was changed has another time of
# change, which nobody can set back: if this is as it was, so is the digest; if not, that decides.
phil_glance() {
  (
    cd "$PHIL_ROOT" || exit
    find "$@" -type f -not -name '*.pyc' -not -path '*/__pycache__/*' -not -path '*/test/*' -printf '%p %s %i %T@ %C@\n' 2>/dev/null | LC_ALL=C sort
    "$PHIL_VENV/bin/python" -V
    echo "$PHIL_ROS $PHIL_ROOT"
  ) | sha256sum
}

# Whether what a stamp stands for is as it was: phil_fresh STAMP PATHS...
phil_fresh() {
  local stamp="$1" glance
  shift
  [ -f "$stamp" ] || return
  glance="$(phil_glance "$@")"
  [ -f "$stamp-glance" ] && [ "$(<"$stamp-glance")" = "$glance" ] && return
  [ "$(<"$stamp")" = "$(phil_digest "$@")" ] || return
  printf '%s' "$glance" >"$stamp-glance"
}

phil_build() {
  local messages="$PHIL_ROOT/install/.phil-messages" packages="$PHIL_ROOT/install/.phil-packages" log="$PHIL_ROOT/log/build.txt"
  local nodes=(phil_base phil_node catenary_model impedance_mpc test_rig_sim energy_monitor phil_loop) todo=() fresh=()
  local of_messages=(interfaces/phil_interfaces install/phil_interfaces)
  local of_packages=(interfaces/phil_base interfaces/phil_node catenary_model impedance_mpc test_rig_sim energy_monitor scripts "${nodes[@]/#/install/}")
  if ! phil_fresh "$messages" "${of_messages[@]}"; then
    phil_say "building messages (half a minute the first time)"
    fresh=(phil_interfaces "${nodes[@]}") todo=(phil_interfaces "${nodes[@]}")
  elif ! phil_fresh "$packages" "${of_packages[@]}"; then
    phil_say "building nodes"
    fresh=("${nodes[@]}") todo=("${nodes[@]}")
  fi
  [ "${#todo[@]}" -eq 0 ] && return
  phil_check_system
  mkdir -p "$PHIL_ROOT/log" "$PHIL_ROOT/install"
  # From scratch: what is there is only overwritten by files of a later date, and a file put back is an older one.
  rm -rf "${fresh[@]/#/$PHIL_ROOT/build/}" "${todo[@]/#/$PHIL_ROOT/install/}" "$packages"
  [ "${todo[0]}" = phil_interfaces ] && rm -f "$messages"
  (
    cd "$PHIL_ROOT" &&
      python -m colcon build --packages-select "${todo[@]}" --event-handlers console_direct- console_cohesion+ >"$log" 2>&1
  ) || {
    tail -n 40 "$log" >&2
    phil_fail "the build failed; all of it is in $log"
  }
  phil_digest "${of_messages[@]}" >"$messages"
  phil_digest "${of_packages[@]}" >"$packages"
}

phil_environment() {
  local purpose="$1"
  # Inside an activated virtual environment of ours, python3 would be that one: take the one it was made from.
  PHIL_PYTHON="${PHIL_PYTHON:-$(PATH="${PATH//"$PHIL_ROOT/.venv-ros/bin:"/}"; PATH="${PATH//"$PHIL_ROOT/.venv/bin:"/}"; command -v python3 || echo python3)}"
  if [ -n "${ROS_DISTRO:-}" ] && [ -n "${AMENT_PREFIX_PATH:-}" ]; then
    [ "$ROS_DISTRO" = jazzy ] || phil_fail "ROS 2 $ROS_DISTRO is sourced; Jazzy is needed (or a shell without ROS 2: then wheels are used)"
    local prefix rclpy=
    while IFS= read -r -d : prefix; do [ -d "$prefix/share/rclpy" ] && rclpy="$prefix"; done <<<"$AMENT_PREFIX_PATH:"
    [ -n "$rclpy" ] ||
      phil_fail "ROS_DISTRO is set, but no folder of AMENT_PREFIX_PATH ($AMENT_PREFIX_PATH) holds rclpy: source /opt/ros/jazzy/setup.bash again, or use a shell without ROS 2 (then wheels are used)"
    PHIL_ROS=sourced PHIL_VENV="$PHIL_ROOT/.venv-ros"
  else
    PHIL_ROS=wheels PHIL_VENV="$PHIL_ROOT/.venv"
    unset AMENT_PREFIX_PATH PYTHONPATH
  fi
  phil_check_path
  # One set-up at a time: two scripts started together must not install into each other.
  exec 9>"$PHIL_ROOT/.phil-setup.lock"
  command -v flock >/dev/null && flock 9
  phil_install "$purpose"
  # shellcheck disable=SC1091
  . "$PHIL_VENV/bin/activate"
  [ "$PHIL_ROS" = wheels ] && export AMENT_PREFIX_PATH="$VIRTUAL_ENV"
  phil_build
  exec 9>&-
  set +u # colcon's scripts read variables that are not set
  # shellcheck disable=SC1091
  . "$PHIL_ROOT/install/local_setup.bash"
  set -u
  # Small matrices: threads of the BLAS only fight with the other nodes for the cores.
  export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
  export PYTHONUNBUFFERED=1 RCUTILS_COLORIZED_OUTPUT=0
  # A rig does not listen to the neighbours' rigs unless it is told to.
  [ -n "${ROS_LOCALHOST_ONLY:-}" ] || export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
  export PHIL_ROOT # rides and documents lie there, wherever Python's modules are installed
}
