#!/usr/bin/env bash
# Installs what is missing, builds, and runs all tests: the gate of every change.
#
#   bash ci/test.sh [--no-install]
#
# In order: layers, format, release build with every test, ASan + UBSan build with the unit tests.
# All of them run even if one fails. Results as JUnit XML: out/test/junit.xml, out/test/asan.xml.
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
source "$root/ci/suites.sh"

install=yes
case ${1:-} in
  '') ;;
  --no-install) install=no ;;
  *) die "unknown option '$1'; the only one is --no-install" ;;
esac

ensure_packages "$install" build check
cd "$root"
gate_suites
close_suites
