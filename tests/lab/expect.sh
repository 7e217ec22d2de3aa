# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# For scripts in the emulated machine: what is expected, one line each, and whether all of it came true.

expect_total=0
expect_unmet=0

# expect TEXT COMMAND...: COMMAND succeeds. What it printed is shown where it does not.
expect() {
  local text=$1 printed
  shift
  expect_total=$((expect_total + 1))
  if printed=$("$@" 2>&1); then
    printf 'ok      %s\n' "$text"
  else
    expect_unmet=$((expect_unmet + 1))
    printf 'FAILED  %s: %s\n' "$text" "$*"
    printf '%s\n' "$printed" | sed 's/^/        /'
  fi
}

# expect_not TEXT COMMAND...: COMMAND fails.
expect_not() {
  local text=$1
  shift
  expect "$text" fails "$@"
}
fails() { ! "$@"; }

# expect_within SECONDS TEXT COMMAND...: it succeeds within that time.
expect_within() {
  local seconds=$1 text=$2
  shift 2
  expect "$text (within $seconds s)" comes_true "$seconds" "$@"
}
comes_true() {
  local end=$((SECONDS + $1)) printed
  shift
  until printed=$("$@" 2>&1); do
    if ((SECONDS >= end)); then
      printf '%s\n' "$printed"
      return 1
    fi
    sleep 0.2
  done
}

# says PATTERN COMMAND...: it prints a line that matches, whether it succeeds or not.
says() {
  local pattern=$1 printed
  shift
  printed=$("$@" 2>&1) || true
  printf '%s\n' "$printed"
  grep -Eq -- "$pattern" <<<"$printed"
}

# The last line of a script: as many as expected, and whether all were met.
expect_end() {
  printf '%d of %d expectations were met\n' $((expect_total - expect_unmet)) "$expect_total"
  ((expect_unmet == 0 && expect_total > 0))
}
