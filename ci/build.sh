#!/usr/bin/env bash
# Installs the Debian packages that are missing, configures, and builds into build/<preset>.
#
#   bash ci/build.sh                          everything, preset release
#   bash ci/build.sh dev --target piecework   one target of another preset
#   bash ci/build.sh --no-install             lists missing packages and exits 2 instead
#
# Presets: release (benchmarks too), dev (assertions), asan, tsan. JOBS=n sets the parallel jobs.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

preset=release
install=yes
targets=()
while [ $# -gt 0 ]; do
  case $1 in
    --no-install) install=no ;;
    --target)
      [ $# -ge 2 ] || die "--target needs a name"
      targets+=("$2")
      shift
      ;;
    -h | --help)
      sed -n '2,/^source/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
      exit 0
      ;;
    -*) die "unknown option '$1'; see bash ci/build.sh --help" ;;
    *) preset=$1 ;;
  esac
  shift
done
grep -q "\"name\": \"$preset\", \"inherits\"" "$root/CMakePresets.json" ||
  die "unknown preset '$preset'; there are: release, dev, asan, tsan"

ensure_packages "$install" build
sanitizer_environment # the build runs the test programs to list their tests
say "Building ${targets[*]:-everything} (preset $preset, $jobs jobs); log: build/$preset/build.log"
start=$SECONDS
configure "$preset"
build "$preset" "${targets[@]}"
say "Built in $((SECONDS - start)) s: build/$preset/bin/"
