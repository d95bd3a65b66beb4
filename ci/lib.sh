#!/usr/bin/env bash
# Shared by the scripts in ci/; to be sourced by bash. Messages go to stderr, results to stdout.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=${JOBS:-$(nproc)}

# Objects are shared between checkouts in different folders.
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$root} CCACHE_NOHASHDIR=${CCACHE_NOHASHDIR:-1}

say() { printf '%s\n' "$*" >&2; }
die() { say "error: $*"; exit 1; }

# packages GROUP...: the names in ci/packages.txt that belong to the groups.
packages() {
  sed 's/#.*//' "$root/ci/packages.txt" |
    awk -v groups=" $* " 'NF >= 2 && index(groups, " " $2 " ") { print $1 }'
}

# missing_packages GROUP...: those of them that are not installed, on one line.
missing_packages() {
  local wanted installed name missing=()
  wanted=$(packages "$@")
  # shellcheck disable=SC2086 # one word per package
  installed=$(dpkg-query -W -f='${db:Status-Abbrev} ${Package}\n' $wanted 2>/dev/null |
    awk '$1 ~ /^.i/ { print $2 }') || true
  for name in $wanted; do
    grep -qxF -e "$name" <<<"$installed" || missing+=("$name")
  done
  printf '%s' "${missing[*]}"
}

# ensure_packages yes|no GROUP...: installs what is missing, or (no) lists it and exits 2.
ensure_packages() {
  local install=$1 missing
  shift
  if ! command -v dpkg-query >/dev/null; then
    say "note: this is no Debian system; needed are what Debian 12 calls: $(packages "$@" | xargs)"
    return
  fi
  missing=$(missing_packages "$@")
  [ -n "$missing" ] || return 0
  if [ "$install" = no ]; then
    say "Missing packages: $missing"
    say "Install them with: apt-get install --no-install-recommends $missing"
    exit 2
  fi
  install_packages "$missing"
}

install_packages() {
  local as_root=() log try
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null ||
      die "packages are missing and only root can install them: apt-get install --no-install-recommends $1"
    as_root=(sudo)
  fi
  log=$(mktemp)
  say "Installing $(wc -w <<<"$1") Debian packages: $1"
  for try in 1 2; do
    # shellcheck disable=SC2086 # one word per package
    if with_progress "$log" "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
      sh -c 'apt-get update -q &&
            exec apt-get -o DPkg::Lock::Timeout=120 install -yq --no-install-recommends "$@"' sh $1; then
      rm -f "$log"
      return
    fi
    [ "$try" = 2 ] || { say "Installing failed; trying once more in 5 seconds"; sleep 5; }
  done
  tail -n 4 "$log" >&2
  die "the packages could not be installed; the whole log is $log"
}

# with_progress LOG COMMAND...: runs the command with its output in LOG; every 20 seconds one line
# says how far it is. Returns the command's exit status; ends the command when we are ended.
with_progress() {
  local log=$1 pid waited=0 status=0
  shift
  mkdir -p "$(dirname "$log")"
  "$@" >"$log" 2>&1 </dev/null &
  pid=$!
  trap 'kill "$pid" 2>/dev/null; exit 130' INT TERM
  while kill -0 "$pid" 2>/dev/null; do
    sleep 0.2
    waited=$((waited + 1))
    [ $((waited % 100)) -ne 0 ] || say "  $((waited / 5)) s$(last_progress "$log")"
  done
  wait "$pid" || status=$?
  trap - INT TERM
  return "$status"
}

# The newest step count of ninja ("[12/340]") or ctest (" 12/340 Test") in a log, as ", 12/340".
last_progress() {
  tail -n 40 "$1" | sed -nE 's/^(\[|[ ]*)([0-9]+\/[0-9]+)(\]| Test).*/, \2/p' | tail -n 1
}

# configure PRESET: into build/PRESET.
configure() {
  local preset=$1 launcher=() log="$root/build/$1/configure.log"
  ! command -v ccache >/dev/null || launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  if ! with_progress "$log" cmake -S "$root" --preset "$preset" "${launcher[@]}"; then
    grep -A 12 -m 1 'CMake Error' "$log" >&2 || tail -n 15 "$log" >&2
    die "configuring preset '$preset' failed; the whole log is $log"
  fi
}

# build PRESET [TARGET...]: everything, or the targets, in build/PRESET.
build() {
  local preset=$1 log="$root/build/$1/build.log" target options=()
  shift
  for target in "$@"; do options+=(--target "$target"); done
  if ! with_progress "$log" cmake --build "$root/build/$preset" -j "$jobs" "${options[@]}"; then
    { grep -m 5 -A 4 -E '(error|Error):|undefined reference' "$log" || tail -n 15 "$log"; } >&2
    die "building preset '$preset' failed; the whole log is $log"
  fi
}

# The C++ files under version control (or, outside of git, of the source folders), one a line.
cpp_files() {
  git -C "$root" ls-files '*.cpp' '*.hpp' 2>/dev/null ||
    (cd "$root" && find src renderer benchmarks examples -name '*.cpp' -o -name '*.hpp' | sort)
}

# Options of the sanitizers, with the suppressions of ci/sanitizers where there are any.
sanitizer_environment() {
  local dir="$root/ci/sanitizers"
  export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
  export UBSAN_OPTIONS=print_stacktrace=1
  export LSAN_OPTIONS=print_suppressions=0
  export TSAN_OPTIONS=halt_on_error=1:history_size=4
  [ ! -f "$dir/asan.supp" ] || ASAN_OPTIONS+=":suppressions=$dir/asan.supp"
  [ ! -f "$dir/ubsan.supp" ] || UBSAN_OPTIONS+=":suppressions=$dir/ubsan.supp"
  [ ! -f "$dir/lsan.supp" ] || LSAN_OPTIONS+=":suppressions=$dir/lsan.supp"
  [ ! -f "$dir/tsan.supp" ] || TSAN_OPTIONS+=":suppressions=$dir/tsan.supp"
}
