#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# kms.sh BIN SOURCE WIDTH HEIGHT: in the emulated machine, with a display of that size: what Veneer
# shows on it. Pictures that are to be equal are left in /run/lab: NAME.ppm of the screen beside NAME.png
# as expected, and NAME.codes says by how much they may differ. lab.sh compares them.
set -euo pipefail
bin=$1
source=$2
width=$3
height=$4
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"

# answer PATTERN: the next line of the program that says it, within a minute.
answer() {
  local line
  while IFS= read -r -t 60 line <&"${program[0]}"; do
    printf '        %s\n' "$line"
    [[ $line =~ $1 ]] && return 0
  done
  return 1
}

# shown NAME BUFFERS: the known picture, on the screen from buffers of that kind; dark after it.
shown() {
  local name=$1 buffers=$2 status=0
  coproc program { exec "$bin/veneer_lab_kms_picture" \
    "driver = \"kms\"
mode = \"${width}x$height\"
buffers = \"$buffers\"
state_directory = \"/run/state\"" "$width" "$height" "/run/lab/$name.png" 2>&1; }
  # shellcheck disable=SC2154  # coproc assigns it
  local id=$program_PID
  if expect_line "presented" "$name: the picture is presented"; then
    expect "$name: the screen is kept" "$source/tests/lab/keep_screen.sh" "$name"
    echo 0 >"/run/lab/$name.codes"
    echo blank >&"${program[1]}"
    expect_line "blank" "$name: it goes dark when told to"
    expect "$name: the dark screen is kept" "$source/tests/lab/keep_screen.sh" "$name-dark"
    # All zeros, whatever was there before.
    expect "$name: it is black" is_black "/run/lab/$name-dark.ppm"
  fi
  eval "exec ${program[1]}>&-"
  wait "$id" || status=$?
  expect "$name: the program ends well" test "$status" = 0
}
expect_line() {
  if answer "$1"; then expect "$2" true; else expect "$2" false; return 1; fi
}
is_black() { [[ $(tail -c $((3 * width * height)) "$1" | tr -d '\0' | wc -c) == 0 ]]; }

# The output's own program, told where to leave its picture.
own_picture() {
  local status=0
  coproc program { exec "$bin/veneer_kms_lab_test" --seconds 600 --frames 12 --png /run/lab/output.png \
    "mode=\"${width}x$height\"" 'state_directory="/run/state"' 2>&1; }
  # shellcheck disable=SC2154  # coproc assigns it
  local id=$program_PID
  if expect_line "^presented" "output: its picture is presented"; then
    expect "output: the screen is kept" "$source/tests/lab/keep_screen.sh" output
    echo 0 >/run/lab/output.codes
  fi
  kill "$id" 2>/dev/null || true
  wait "$id" || status=$?
  expect "output: it held the picture until it was killed" test "$status" = 143
}

# ends STATUS TEXT KEY=VALUE...: a program that opens such an output ends with that status and says so.
ends() {
  local wanted=$1 text=$2 status=0
  shift 2
  printf '%s\n' 'driver = "kms"' "$@" >/run/output.toml
  "$bin/veneer_lab_kms_picture" "$(cat /run/output.toml)" "$width" "$height" /run/none.png \
    </dev/null >/run/said 2>&1 || status=$?
  cat /run/said
  [[ $status == "$wanted" ]] && grep -q -- "$text" /run/said
}

# A name that is wrong ends a service for good; a projector that may only be off does not.
names() {
  local sysfs=/sys/class/drm/card0-Virtual-1/status
  expect "a display is found by its EDID's name" ends 0 'QEMU Monitor' 'connector = "QEMU Monitor"'
  expect "a name that is nowhere is a mistake" ends 2 'card0 Virtual-1: QEMU Monitor' 'connector = "NO SUCH"'
  expect "and so is a mode" ends 2 'no mode' 'mode = "123x45"'
  echo off >"$sysfs"
  expect "that of a display that is off may be right" ends 1 'switch it on' 'connector = "QEMU Monitor"'
  expect "its socket waits for it" ends 1 'switch the projector on' 'connector = "Virtual-1"' 'mode = "123x45"'
  echo detect >"$sysfs"
  # By its socket: virtio-gpu does not hand out the EDID of such a display a second time.
  expect "it is found once it is on" ends 0 'on Virtual-1' 'connector = "Virtual-1"'
  expect "its name may come yet" ends 1 'switch it on' 'connector = "QEMU Monitor"'
}

mkdir -p /run/state
names
# Wide vectors are slow in emulation.
export LP_NATIVE_VECTOR_WIDTH=128
status=0
"$bin/veneer_scanout_lab_test" --gtest_brief=1 || status=$?
expect "the renderer draws into a display's buffers" test "$status" = 0
own_picture
shown pixels-mapped mapped
shown pixels-given-up auto
expect_end
