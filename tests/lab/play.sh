#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# To be sourced in the emulated machine, where $bin has the programs: USB devices that are plugged into it.
# shellcheck disable=SC2154  # bin
mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config
declare -A player to from

# play KIND: such a device, which then hears what is told, until stop.
play() {
  local wires fd
  wires=$(mktemp -d)
  mkfifo "$wires/to" "$wires/from"
  # Without the wires of others, which would never end then.
  (
    for fd in "${to[@]}" "${from[@]}"; do exec {fd}>&-; done
    exec "$bin/veneer_lab_usb_device" "$1"
  ) <"$wires/to" >"$wires/from" &
  player[$1]=$!
  exec {fd}>"$wires/to"
  to[$1]=$fd
  exec {fd}<"$wires/from"
  from[$1]=$fd
  rm -r "$wires"
}
# stop KIND
stop() {
  local fd=${to[$1]}
  exec {fd}>&-
  fd=${from[$1]}
  exec {fd}<&-
  wait "${player[$1]}" || true
}
# tell KIND LINE: to the device that is played, which then says the same, or a value.
tell() {
  local answer
  echo "$2" >&"${to[$1]}"
  IFS= read -r -t 30 answer <&"${from[$1]}" || return 1
  echo "$answer"
  udevadm settle --timeout=20
  [[ $answer != error* ]]
}
