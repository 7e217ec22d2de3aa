#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usb.sh BIN SOURCE: in the emulated machine, the drivers of USB devices over the kernel's own USB stack,
# with the real udev and the rules of SOURCE/etc/udev; BIN has the programs.
set -euo pipefail
bin=$1
source=$2
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"

mount -t configfs none /sys/kernel/config
mkdir -p /etc/udev/rules.d
cp "$source"/etc/udev/*.rules /etc/udev/rules.d/
systemd-sysusers "$source/etc/sysusers.d/veneer.conf"
/lib/systemd/systemd-udevd --daemon
# Where everybody may run it.
cp "$bin/veneer" /run/veneer

status=0
"$bin/veneer_usb_lab_test" --gtest_brief=1 || status=$?
expect "the drivers hold their laws" test "$status" = 0

# play KIND: such a device, which then hears what is told, until stop.
play() {
  coproc device { exec "$bin/veneer_lab_usb_device" "$1"; }
  # shellcheck disable=SC2154  # coproc assigns it
  player=$device_PID
  # Copies, since subshells lose the descriptors of a coprocess.
  exec 8>&"${device[1]}" 9<&"${device[0]}"
  eval "exec ${device[1]}>&-"
}
stop() {
  exec 8>&- 9<&-
  wait "$player" || true
}
# tell LINE: to the device that is played, which then says the same, or a value.
tell() {
  local answer
  echo "$1" >&8
  IFS= read -r -t 30 answer <&9 || return 1
  echo "$answer"
  udevadm settle --timeout=20
  [[ $answer != error* ]]
}
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
expect "a light engine is plugged in" tell plug
mapfile -t nodes < <(hidraw_of 0451 6401)
expect "it has two nodes" test "${#nodes[@]}" = 2
rights "light engine" "${nodes[0]}"
control=(/run/veneer projector --json --driver dlpc350)
expect "veneer projector tells its state" says '"led_levels"' \
  as veneer "${control[@]}" status
expect "veneer projector blanks it" as veneer "${control[@]}" blank
expect "its LEDs are off" says '^0$' tell "value 1A07"
expect "a stranger is told which rule to install" says '60-veneer-projectors.rules' as nobody "${control[@]}" status
expect "it is pulled out" tell unplug
stop

play colorhug
expect "a colorimeter is plugged in" tell plug
rights colorimeter "$(hidraw_of 273F 1004)"
stop

play liberty
expect "a tracker is plugged in" tell plug
for folder in /sys/bus/usb/devices/*; do
  if [[ $(cat "$folder/idVendor" 2>/dev/null) == 0f44 ]]; then
    rights tracker "$(printf '/dev/bus/usb/%03d/%03d' "$(cat "$folder/busnum")" "$(cat "$folder/devnum")")"
    expect "veneer track sees it" says 'LIBERTY' as veneer /run/veneer track list
  fi
done
stop
expect_end
