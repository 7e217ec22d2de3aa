#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# kms_daemon.sh BIN SOURCE SHOW: in the emulated machine, with a display of the size of SHOW's profile:
# veneerd shows on it what it draws into files, to within its dither; the GPU's buffers are what is scanned
# out. The text console stays away, whoever switches it, and is back after the end.
set -euo pipefail
bin=$1
source=$2
show=$3
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"

# Wide vectors are slow in emulation; shaders are compiled once.
export LP_NATIVE_VECTOR_WIDTH=128 MESA_SHADER_CACHE_DIR=/run/shaders
veneerd=("$bin/veneerd" --config "$show/veneer.toml" --set 'state_directory="/run/state"')

expect "frames are drawn into files" "${veneerd[@]}" --set frames=2 --set 'output.driver="file"' \
  --set 'output.folder="/run/lab/frames"'
expected=$(find /run/lab/frames -name '*.png' | sort | tail -n 1)

keep_screen() { "$source/tests/lab/keep_screen.sh" daemon; }
is_the_frame() { python3 "$source/tests/lab/compare_pictures.py" "$expected" /run/lab/daemon.ppm 1; }
shows_the_frame() { keep_screen && is_the_frame; }
# What is lit: bytes that are not 0.
light() { keep_screen && tail -n +4 /run/lab/daemon.ppm | tr -d '\0' | wc -c; }
is_lit() { (($(light) > 0)); }
# Of the console that is in front: something to be seen, all over it.
fill_console() { printf '%0200d' 8 >/dev/tty0; }
saved() { compgen -G '/run/state/kms-card0-*.json'; }

expect "the console is in front" busybox chvt 1
fill_console
expect_within 60 "the screen shows the console" is_lit
log=/run/lab/veneerd.log
"${veneerd[@]}" --set 'output.driver="kms"' --set 'output.buffers="gpu"' --set 'summary="/run/summary.json"' \
  >"$log" 2>&1 &
daemon=$!
expect_within 240 "the screen shows what is drawn" shows_the_frame
expect "the colours that were found are saved in the daemon's state directory" saved
for console in 2 1; do
  expect "the console is switched to $console" timeout 30 busybox chvt "$console"
  fill_console
  # What was scanned out before it was switched is no proof.
  sleep 2
  expect_within 60 "the screen shows what is drawn" shows_the_frame
done
kill -TERM "$daemon"
status=0
wait "$daemon" || status=$?
expect "veneerd ends well" test "$status" = 0
expect "the renderer drew into the display's buffers to the end" grep -q 'drawn by the GPU in place' /run/summary.json
expect_not "no pixels were copied" grep -q 'pixels are copied' "$log"
expect_not "the colours are no longer kept" saved
fill_console
expect_within 60 "the screen shows the console again" is_lit
expect_not "and not what was drawn" is_the_frame
cat "$log"
expect_end
