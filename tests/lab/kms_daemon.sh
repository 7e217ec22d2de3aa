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

# Compile shaders without making them fast, and once.
export GALLIVM_PERF=nopt MESA_SHADER_CACHE_DIR=/run/shaders STATE_DIRECTORY=/run/state
mkdir -p /run/state
veneerd=("$bin/veneerd" --quiet --config "$show/veneer.toml")

expect "frames are drawn into files" "${veneerd[@]}" --set frames=6 --set 'output.driver="file"' \
  --set 'output.folder="/run/lab/frames"'
expected=$(find /run/lab/frames -name '*.png' | sort | tail -n 1)

shows_the_frame() {
  "$source/tests/lab/keep_screen.sh" daemon && python3 "$source/tests/lab/compare_pictures.py" "$expected" \
    /run/lab/daemon.ppm 1
}
log=/run/lab/veneerd.log
"${veneerd[@]}" --set 'output.driver="kms"' >"$log" 2>&1 &
daemon=$!
expect_within 240 "the screen shows what is drawn" shows_the_frame
kill -TERM "$daemon"
status=0
wait "$daemon" || status=$?
expect "veneerd ends well" test "$status" = 0
expect_not "and let go of the screen" shows_the_frame
cat "$log"
expect_end
