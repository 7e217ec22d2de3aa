#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# prepare_show.sh BIN SOURCE FOLDER: something small to show in the emulated machine, made by Veneer's
# own programs: a material, a profile of 96 x 72 pixels and a scene that is seen by an eye that stands still, so
# that every frame is the same but for its dither, and drawn in less than a second there.
set -euo pipefail
bin=$1
source=$2
folder=$3
rm -rf "$folder"
mkdir -p "$folder"
"$bin/veneer" synthesize cloth --quiet --size 8 --views 25 --lights 25 --samples 1 -o "$folder/cloth.btfset"
"$bin/veneer" fit "$folder/cloth.btfset" --quiet --model texel-colours --components 3+1 --clusters 2 \
  --angular 8 -o "$folder/material.safetensors"
# The demo's projector, seen through fewer pixels; its table stands first in the file.
sed -e '/^\[projector.red\]/q' "$source/etc/benches/demo.toml" |
  sed -e 's/^width = 640/width = 96/' -e 's/^height = 480/height = 72/' \
    -e 's/^focal_px.*/focal_px = [396.0, 396.0]/' \
    -e 's/^principal_point.*/principal_point = [48.2, 35.7]/' >"$folder/bench.toml"
sed -e '1,/^\[projector.red\]/d' "$source/etc/benches/demo.toml" >>"$folder/bench.toml"
"$bin/veneer" calibrate --quiet --yes --board-poses 5 --bench "$folder/bench.toml" -o "$folder/profile"
rm -rf "$folder/cloth.btfset" "$folder/bench.toml" "$folder/profile.session"
cp "$source/etc/demo/scene.toml" "$folder/"
cat >"$folder/veneer.toml" <<'TOML'
scene = "scene.toml"
material = "material.safetensors"
profile = "profile"
frame_rate_hz = 2

[tracker]
driver = "simulated"
rate_hz = 60

[[tracker.path]]
body = 0
kind = "walk"                  # at rest: from an angle to itself
centre = [0.0, 0.0, 0.0]
radius_m = 0.9
height_m = 0.2
from_deg = 10
to_deg = 10
period_s = 8

[output]
driver = "null"
TOML
