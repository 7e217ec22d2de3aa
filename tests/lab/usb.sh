#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usb.sh BIN SOURCE: in the emulated machine, the drivers of USB devices over the kernel's own USB stack,
# with the real udev and the rules of SOURCE/etc/udev; BIN has the programs.
set -euo pipefail
bin=$1
source=$2
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"
# shellcheck source=tests/lab/play.sh
. "$source/tests/lab/play.sh"

mkdir -p /etc/udev/rules.d
cp "$source"/etc/udev/*.rules /etc/udev/rules.d/
systemd-sysusers "$source/etc/sysusers.d/veneer.conf"
/lib/systemd/systemd-udevd --daemon
# Where everybody may run it.
cp "$bin/veneer" /run/veneer

status=0
"$bin/veneer_usb_lab_test" --gtest_brief=1 || status=$?
expect "the drivers hold their laws" test "$status" = 0

as() {
  local user=$1
  shift
  setpriv --reuid "$user" --regid "$(id -g "$user")" --init-groups -- "$@"
}
opens() { as "$1" sh -c ": <>$2"; }

# rights NAME NODE: those that the rules give.
rights() {
  expect "$1: the node belongs to plugdev, and to nobody else" says '^660 root plugdev$' stat -c '%a %U %G' "$2"
  expect "$1: whoever sits at the machine may open it (uaccess)" says '^E: TAGS=.*:uaccess:' udevadm info "$2"
  expect "$1: the user veneer opens it" opens veneer "$2"
  expect_not "$1: the user nobody does not" opens nobody "$2"
}
hidraw_of() {
  local node
  for node in /sys/class/hidraw/*; do
    if grep -q "^HID_ID=0003:0000$1:0000$2" "$node/device/uevent"; then echo "/dev/$(basename "$node")"; fi
  done
}

play light-engine
expect "a light engine is plugged in" tell light-engine plug
mapfile -t nodes < <(hidraw_of 0451 6401)
expect "it has two nodes" test "${#nodes[@]}" = 2
rights "light engine" "${nodes[0]}"
control=(/run/veneer projector --json --driver dlpc350)
expect "veneer projector tells its state" says '"led_levels"' \
  as veneer "${control[@]}" status
expect "veneer projector blanks it" as veneer "${control[@]}" blank
expect "its LEDs are off" says '^0$' tell light-engine "value 1A07"
expect "a stranger is told which rule to install" says '60-veneer-projectors.rules' as nobody "${control[@]}" status
expect "it is pulled out" tell light-engine unplug
stop light-engine

play colorhug
expect "a colorimeter is plugged in" tell colorhug plug
rights colorimeter "$(hidraw_of 273F 1004)"
stop colorhug

play liberty
expect "a tracker is plugged in" tell liberty plug
for folder in /sys/bus/usb/devices/*; do
  if [[ $(cat "$folder/idVendor" 2>/dev/null) == 0f44 ]]; then
    rights tracker "$(printf '/dev/bus/usb/%03d/%03d' "$(cat "$folder/busnum")" "$(cat "$folder/devnum")")"
    expect "veneer track sees it" says 'LIBERTY' as veneer /run/veneer track list
  fi
done
stop liberty
expect_end
