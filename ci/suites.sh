#!/usr/bin/env bash
# Suites of ci/test.sh and ci/full.sh: each runs whatever happened before it and leaves one line of
# the closing table. To be sourced after lib.sh.

suite_rows=()
suite_counts=$(mktemp) # "passed failed skipped", written by a suite that runs more than one test
trap 'rm -f "$suite_counts"' EXIT
total_passed=0 total_failed=0 total_skipped=0

# run_suite NAME COMMAND...: runs a command or function; in its own subshell, so that it may exit.
run_suite() {
  local name=$1 start=$SECONDS status=0 passed failed skipped seconds
  shift
  say "== $name"
  : >"$suite_counts"
  set +e
  (
    trap - EXIT
    set -e
    "$@"
  )
  status=$?
  set -e
  seconds=$((SECONDS - start))
  if [ -s "$suite_counts" ]; then
    read -r passed failed skipped _ <"$suite_counts"
    # A crash of ctest itself must not look like success.
    [ "$status" -eq 0 ] || [ "$failed" -gt 0 ] || failed=1
  elif [ "$status" -eq 0 ]; then
    passed=1 failed=0 skipped=0
  else
    passed=0 failed=1 skipped=0
  fi
  total_passed=$((total_passed + passed))
  total_failed=$((total_failed + failed))
  total_skipped=$((total_skipped + skipped))
  suite_rows+=("$(printf '%-12s %7d %7d %8d %7d' "$name" "$passed" "$failed" "$skipped" "$seconds")")
}

# tests_of PRESET JUNIT [LABEL]: builds and runs the tests (of one label: builds only those).
tests_of() {
  local preset=$1 junit="$root/out/test/$2" label=${3:-} status=0 targets=() options=()
  local log="$root/build/$preset/ctest.log"
  sanitizer_environment
  if [ -n "$label" ]; then
    targets=("${label}_tests")
    options=(-L "^$label\$")
  fi
  configure "$preset"
  build "$preset" "${targets[@]}"
  mkdir -p "$root/out/test"
  rm -f "$junit"
  with_progress "$log" ctest --test-dir "$root/build/$preset" -j "$jobs" --output-on-failure \
    --no-tests=error --output-junit "$junit" "${options[@]}" || status=$?
  [ "$status" -eq 0 ] || failures_in "$log"
  sed -n '/% tests passed/,$p' "$log"
  if [ "$preset" = release ] && [ -f "$junit" ]; then cp "$junit" "$root/build/release/junit.xml"; fi
  "$root/ci/junit_counts" "$junit" >"$suite_counts"
  return "$status"
}

# gate_suites: those of ci/test.sh, which every change must pass.
gate_suites() {
  run_suite layers "$root/ci/check_layers"
  run_suite format "$root/ci/check_format"
  run_suite release tests_of release junit.xml
  run_suite asan tests_of asan asan.xml unit
}

# failures_in LOG: what the failed tests of a ctest log printed, cut to 40 lines each, 200 in all.
failures_in() {
  awk '/^ *Start +[0-9]+:|^ *[0-9]+\/[0-9]+ Test|% tests passed/ { left = 0 }
       /\*\*\*(Failed|Timeout|Exception|Not Run$)/ { left = 40 }
       left-- > 0 && ++printed <= 200' "$1"
}

# close_suites: the closing table; exits 1 if anything failed.
close_suites() {
  printf '\n%-12s %7s %7s %8s %7s\n' suite passed failed skipped seconds
  printf '%s\n' "${suite_rows[@]}"
  printf '\ntotal: %d passed, %d failed, %d skipped\n' "$total_passed" "$total_failed" "$total_skipped"
  [ "$total_failed" -eq 0 ] || exit 1
}
