#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# kms_daemon.sh BIN SOURCE SHOW: in the emulated machine, with a display of the size of SHOW's profile:
# veneerd shows on it what it draws into files, to within its dither.
set -euo pipefail
bin=$1
source=$2
show=$3
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"

# Wide vectors are slow in emulation; shaders are compiled once.
export LP_NATIVE_VECTOR_WIDTH=128 MESA_SHADER_CACHE_DIR=/run/shaders STATE_DIRECTORY=/run/state
mkdir -p /run/state
veneerd=("$bin/veneerd" --quiet --config "$show/veneer.toml")

expect "frames are drawn into files" "${veneerd[@]}" --set frames=2 --set 'output.driver="file"' \
  --set 'output.folder="/run/lab/frames"'
expected=$(find /run/lab/frames -name '*.png' | sort | tail -n 1)

keep_screen() { "$source/tests/lab/keep_screen.sh" daemon; }
is_the_frame() { python3 "$source/tests/lab/compare_pictures.py" "$expected" /run/lab/daemon.ppm 1; }
shows_the_frame() { keep_screen && is_the_frame; }
log=/run/lab/veneerd.log
"${veneerd[@]}" --set 'output.driver="kms"' >"$log" 2>&1 &
daemon=$!
expect_within 240 "the screen shows what is drawn" shows_the_frame
kill -TERM "$daemon"
status=0
wait "$daemon" || status=$?
expect "veneerd ends well" test "$status" = 0
expect "the screen is kept" keep_screen
expect_not "of which it let go" is_the_frame
cat "$log"
expect_end
