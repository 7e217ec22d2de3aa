#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# keep_screen.sh NAME: in the emulated machine, keeps the picture that is scanned out as NAME.ppm in
# /run/lab. Speaks QMP with the emulator that run_in_kernel.sh plugged into the machine.
set -euo pipefail
port=(/dev/vport*p1)
[[ -c ${port[0]} ]] || { echo "lab: this machine has no screen" >&2; exit 1; }
exec 3<>"${port[0]}"
# The greeting may be gone, and so may the need for the first command: only the last answer counts.
printf '%s' '{"execute": "qmp_capabilities"}' >&3
printf '{"execute": "screendump", "arguments": {"filename": "%s/%s.ppm"}, "id": "kept"}\n' "$LAB_OUT" "$1" >&3
while IFS= read -r -t 30 line <&3; do
  [[ $line == *'"id": "kept"'* ]] || continue
  [[ $line == *'"return"'* ]] && exit 0
  printf 'lab: the screen was not kept: %s\n' "$line" >&2
  exit 1
done
echo "lab: the emulator does not answer, so the screen was not kept" >&2
exit 1
