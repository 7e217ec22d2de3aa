#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# lab.sh BUILD PART...: the parts of the kernel lab one after another, on what is built in BUILD, and
# a table of what passed. Parts: v4l2, usb, kms, service (which takes the newest package of out/).
set -euo pipefail
build=$(readlink -m "$1")
shift
source=$(readlink -f "$(dirname "${BASH_SOURCE[0]}")/../..")
bin=$build/bin
work=$build/lab
kernel=$source/tests/lab/run_in_kernel.sh
show=$work/show

# What is shown, made anew where the programs are.
need_show() {
  if [[ ! -f $show/veneer.toml || $bin/veneer -nt $show/veneer.toml ]]; then
    "$source/tests/lab/prepare_show.sh" "$bin" "$source" "$show"
  fi
}

# The machine's users are made in a copy of this one's list, which only root may read.
need_users() {
  [[ -r /etc/shadow ]] || { echo "lab: /etc/shadow cannot be read; run this part as root" >&2; return 1; }
}

# Gadgets and the controller, of this machine itself, that they are plugged into.
usb_modules=$'dummy_hcd num=2\nlibcomposite\nusb_f_hid\nusb_f_fs\nusb_f_ss_lb\nusbhid\nhid_generic'

v4l2() {
  MODULES="vivid node_types=0x101" LAB_SECONDS=150 "$kernel" "$work" "$bin/veneer_v4l2_lab_test"
}

usb() {
  need_users
  MODULES=$usb_modules LAB_SECONDS=400 "$kernel" "$work" "$source/tests/lab/usb.sh" "$bin" "$source"
}

kms() {
  local status=0 picture
  need_show
  rm -rf "$work/kms" "$work/kms-daemon"
  LAB_SCREEN=1024x768 LAB_OUT=$work/kms LAB_SECONDS=400 \
    "$kernel" "$work" "$source/tests/lab/kms.sh" "$bin" "$source" 1024 768 || status=1
  for picture in "$work"/kms/*.codes; do
    picture=${picture%.codes}
    if python3 "$source/tests/lab/compare_pictures.py" "$picture.png" "$picture.ppm" "$(cat "$picture.codes")"; then
      echo "ok      $(basename "$picture"): the screen equals the picture"
    else
      echo "FAILED  $(basename "$picture"): the screen equals the picture"
      status=1
    fi
  done
  LAB_SCREEN=96x72 LAB_OUT=$work/kms-daemon LAB_SECONDS=400 \
    "$kernel" "$work" "$source/tests/lab/kms_daemon.sh" "$bin" "$source" "$show" || status=1
  return "$status"
}

service() {
  local packages
  need_users
  need_show
  rm -rf "$work/service"
  packages=("$source"/out/veneer_*.deb)
  [[ -f ${packages[-1]} ]] || { echo "no package in out/; make it: ./dev package" >&2; return 1; }
  MODULES=$usb_modules LAB_INIT=systemd LAB_SCREEN=96x72 LAB_OUT=$work/service LAB_SECONDS=800 \
    "$kernel" "$work" "$source/tests/lab/service.sh" "${packages[-1]}" "$source" "$show" "$bin"
}

# Each in a process of its own, where the first error ends the part and no more.
if [[ ${1:-} == --only ]]; then
  case ${2:-} in
    v4l2) v4l2 ;;
    usb) usb ;;
    kms) kms ;;
    service) service ;;
    *)
      echo "lab: no part \"${2:-}\"; there are v4l2, usb, kms, service" >&2
      exit 2
      ;;
  esac
  exit
fi
table=()
failed=0
for part; do
  printf '== lab: %s\n' "$part"
  begin=$SECONDS
  verdict=ok
  "${BASH_SOURCE[0]}" "$build" --only "$part" || verdict="failed ($?)"
  if [[ $verdict != ok ]]; then failed=1; fi
  table+=("$(printf '%-10s %5d s  %s' "$part" $((SECONDS - begin)) "$verdict")")
done
printf '%s\n' "== lab" "${table[@]}"
exit "$failed"
