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
/lib/systemd/systemd-udevd --daemon

"$bin/veneer_usb_lab_test" --gtest_brief=1 && drivers=0 || drivers=$?
expect "the drivers hold their laws" test "$drivers" = 0
expect_end
