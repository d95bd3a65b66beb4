#!/usr/bin/env bash
# clang-tidy 14 with the rules of .clang-tidy; any finding fails.
#
#   ci/tidy.sh                        every source file
#   ci/tidy.sh --changed-since REF    sources changed since a revision, or beside a changed header
#   ci/tidy.sh FILE...                these files
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

# Changed sources, and all sources of a folder in which a header changed.
changed_sources() {
  git diff --name-only --diff-filter=d "$1" -- '*.cpp'
  git diff --name-only --diff-filter=d "$1" -- '*.hpp' | while read -r header; do
    git ls-files "$(dirname "$header")/*.cpp"
  done
}

cd "$root"
[ -f build/release/compile_commands.json ] || configure release
list=build/release/tidy.files
case ${1:-} in
  '') cpp_files | grep '\.cpp$' >"$list" ;;
  --changed-since) changed_sources "${2:?a revision is missing}" | sort -u >"$list" ;;
  -*) die "unknown option '$1'" ;;
  *) printf '%s\n' "$@" >"$list" ;;
esac
[ -s "$list" ] || {
  say "no source file to check"
  exit 0
}

log=build/release/tidy.log
say "clang-tidy on $(wc -l <"$list") files; log: $log"
# -n 1: one process a file; a finding of any of them makes xargs fail.
if ! with_progress "$log" xargs -a "$list" -d '\n' -n 1 -P "$jobs" \
  clang-tidy-14 -p build/release --quiet --warnings-as-errors='*'; then
  grep -E '(warning|error):' "$log" | sort -u >&2
  die "clang-tidy found something; the whole log is $log"
fi
