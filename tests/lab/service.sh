#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# service.sh PACKAGE.deb SOURCE SHOW BIN: in the emulated machine, with systemd as its first process and a
# display of the size of SHOW's profile: veneerd is installed from its package, shows what prepare_show.sh
# made and is started, asked, misconfigured, hung, killed, stopped, and left with devices on USB that BIN plays.
set -euo pipefail
package=$1
source=$2
show=$3
bin=$4
# shellcheck source=tests/lab/expect.sh
. "$source/tests/lab/expect.sh"
# shellcheck source=tests/lab/play.sh
. "$source/tests/lab/play.sh"

name=org.veneer.Veneer1
object=/org/veneer/Veneer1
config=/etc/veneer/veneer.toml
# What the emulated machine is slow at: compiling shaders and drawing. A real one needs a hundredth.
patience=90
watchdog=30

as() {
  local user=$1
  shift
  setpriv --reuid "$user" --regid "$(id -g "$user")" --init-groups -- "$@"
}
get() { busctl get-property "$name" "$object" "$name" "$1"; }
call() { busctl call --timeout=30 "$name" "$object" "$name" "$@"; }
unit() { systemctl show --value -p "$1" veneerd; }
frames() { get Frames | cut -d ' ' -f 2; }
# A frame went out since.
more_frames_than() { (($(frames) > $1)); }
# Started anew: another process, and ready.
is_ready_as_another_than() { [[ $(unit ActiveState) == active && $(unit MainPID) != "$1" ]]; }
# The emulated machine's frames are late, which is a fault in its own right.
shows_a_picture() { says '"(running|degraded)"' get State; }
journal() { journalctl --no-pager -o json -u veneerd "$@"; }
of_systemd() { journalctl --no-pager -o cat UNIT=veneerd.service; }
# What is scanned out, as it is now: the bytes of its pixels that are not 0.
light() {
  "$source/tests/lab/keep_screen.sh" service && tail -n +4 /run/lab/service.ppm | tr -d '\0' | wc -c
}
screen_is_lit() { (($(light) > 0)); }
screen_is_dark() { [[ $(light) == 0 ]]; }
# What was found of the display's colours, kept until they are back.
colours_are_kept() { compgen -G '/var/lib/veneer/kms-card0-*.json'; }
# plug off|detect: what is in the socket, as the kernel then says to all who listen.
plug() {
  echo "$1" >/sys/class/drm/card0-Virtual-1/status
  udevadm trigger --action=change --subsystem-match=drm
  udevadm settle --timeout=30
}

# It says what it does in the journal, not among the lines of this script.
systemctl log-target journal
kill -s RTMIN+21 1
# Displays get their group by udev's rules, as at a start of the machine, which was left out.
udevadm trigger --action=add --subsystem-match=drm
udevadm settle --timeout=60

# --- installed

expect "the package installs" dpkg --install --force-depends --force-unsafe-io --no-triggers "$package"
expect "the user veneer may use displays and devices" says 'video.*plugdev|plugdev.*video' id -Gn veneer
expect "systemd finds nothing wrong with the unit" fails says 'veneerd.service' systemd-analyze verify --man=no veneerd.service
cp -r "$show"/. /etc/veneer/
chmod -R a+rX /etc/veneer
sed -i 's/^driver = "null"/driver = "kms"/' "$config"
cat >>"$config" <<'TOML'

[service]
bus = "system"
TOML
mkdir -p /run/systemd/system/veneerd.service.d
cat >/run/systemd/system/veneerd.service.d/lab.conf <<UNIT
[Service]
WatchdogSec=$watchdog
# Wide vectors are slow in emulation.
Environment=LP_NATIVE_VECTOR_WIDTH=128
UNIT
systemctl daemon-reload
useradd --no-create-home --groups veneer curator

# --- started

expect "it starts, and says when it is ready" timeout 175 systemctl start veneerd
expect "it is active" says '^active$' unit ActiveState
expect "it tells systemd what it is doing" says '.' unit StatusText
expect "it runs as the user veneer" says '^veneer' ps -o user= -p "$(unit MainPID)"
expect_within "$patience" "it shows a picture" shows_a_picture
before=$(frames)
expect_within "$patience" "frames go out" more_frames_than "$before"
expect "to the display" says 'Virtual-1 on /dev/dri/card0' get Output
expect_within "$patience" "which is lit" screen_is_lit
expect "the colours that it found there are kept" colours_are_kept
expect "in a file of its own" says '^veneer$' stat -c %U /var/lib/veneer/kms-card0-*.json

# --- unplugged

unplugged=$(unit MainPID)
expect "the display is pulled out" plug off
expect_within "$patience" "which is a fault" says '"output"' get Faults
expect_within "$patience" "it is its state" says '"fault"' get State
expect "and says what to do" says 'nothing is connected' journalctl --no-pager -o cat -u veneerd
# As long as the watchdog has patience.
sleep "$watchdog"
expect "systemd leaves it alone" test "$(unit MainPID)" = "$unplugged"
expect "the display is plugged in again" plug detect
expect_within "$patience" "the fault is over" fails says '"output"' get Faults
expect_within "$patience" "it shows a picture again" shows_a_picture
before=$(frames)
expect_within "$patience" "frames go out again" more_frames_than "$before"
expect_within "$patience" "the screen is lit again" screen_is_lit
expect "all by one process" test "$(unit MainPID)" = "$unplugged"

# --- asked and told over the bus

expect "the bus tells what there is" says 'State +property +s' busctl introspect "$name" "$object"
expect "and what can be called" says 'LoadMaterial +method +s' busctl introspect "$name" "$object"
expect "a stranger may read" says '"' as nobody busctl get-property "$name" "$object" "$name" State
stranger() { as nobody busctl call "$name" "$object" "$name" "$@"; }
expect "a stranger may not blank it" says '[Aa]ccess *[Dd]enied|not permitted' stranger Blank b true
expect "nor reload it" says '[Aa]ccess *[Dd]enied|not permitted' stranger Reload
expect "nor load a material" says '[Aa]ccess *[Dd]enied|not permitted' stranger LoadMaterial s /etc/veneer/material.safetensors
expect "and all of that changed nothing" shows_a_picture
expect "a member of the group blanks it" as curator busctl call "$name" "$object" "$name" Blank b true
expect_within "$patience" "it is blank" says '"blank"' get State
expect_within "$patience" "and so is the screen" screen_is_dark
expect "root takes that back" call Blank b false
expect_within "$patience" "it shows a picture again" shows_a_picture
expect_within "$patience" "and so does the screen" screen_is_lit
expect "a material that is not there is refused" says 'nothing-here' call LoadMaterial s /nothing-here

# --- a bad configuration

first=$(unit MainPID)
cp -p "$config" /run/good.toml
echo 'this is = no configuration' >>"$config"
systemctl reload veneerd
expect_within "$patience" "a bad configuration is a fault" says '"configuration"' get Faults
before=$(frames)
expect_within "$patience" "and the old one is still shown" more_frames_than "$before"
# As old as before: nothing is to be drawn otherwise, and another renderer takes long here.
cp -p /run/good.toml "$config"
systemctl reload veneerd
expect_within "$patience" "a good one ends the fault" fails says '"configuration"' get Faults
expect "all by one process" test "$(unit MainPID)" = "$first"

# --- hung and killed

kill -STOP "$first"
expect_within $((watchdog + patience)) "one that hangs is killed and started anew" is_ready_as_another_than "$first"
expect "the watchdog did it" says "Failed with result 'watchdog'" of_systemd
expect_within "$patience" "it shows a picture" shows_a_picture
second=$(unit MainPID)
kill -KILL "$second"
expect "one that is killed leaves the colours that it found" colours_are_kept
expect_within "$patience" "one that is killed is started anew" is_ready_as_another_than "$second"
expect "systemd saw it" says 'status=9/KILL' of_systemd
expect "those were two restarts" says '^2$' unit NRestarts
expect_within "$patience" "it shows a picture" shows_a_picture
expect_within "$patience" "on the display" screen_is_lit

# --- killed in the dark

expect "it is blanked" call Blank b true
expect_within "$patience" "the screen is dark" screen_is_dark
third=$(unit MainPID)
kill -KILL "$third"
expect_within "$patience" "one that is killed in the dark is started anew" is_ready_as_another_than "$third"
expect_within "$patience" "and is blank again" says '"blank"' get State
before=$(frames)
expect_within "$patience" "which it goes on to be" more_frames_than "$before"
expect "with nothing on the screen" screen_is_dark
expect "root takes that back" call Blank b false
expect_within "$patience" "it shows a picture" shows_a_picture
expect_within "$patience" "on the display" screen_is_lit
expect "it is blanked once more" call Blank b true
expect "that is remembered" test -e /run/veneer/dark

# --- another version beneath it

running=$(unit MainPID)
expect "a package over the old one says what is left to do" says 'systemctl restart veneerd' dpkg --install --force-depends --force-unsafe-io --no-triggers --force-confold "$package"
expect "and leaves what runs alone" test "$(unit MainPID)" = "$running"
expect "dark as it is" says '"blank"' get State

# --- stopped

expect "the colours are kept again" colours_are_kept
expect "it stops in time" timeout 30 systemctl stop veneerd
expect "it is inactive" says '^inactive$' unit ActiveState
expect "it ended well" says '^success$' unit Result
expect "nothing of the dark is left" fails test -e /run/veneer/dark
expect_not "the colours are back, and kept no longer" colours_are_kept
expect "it left the bus" fails busctl status "$name"
expect "the journal has its states as fields" says '"VENEER_STATE"' journal VENEER_STATE=stopping
expect "and its faults" says '"VENEER_FAULT"' journal VENEER_FAULT=configuration
expect "at the levels of the journal" says '"PRIORITY" *: *"[0-7]"' journal VENEER_FAULT=configuration

# --- tracker and light engine on USB, within the sandbox of its unit and as the user that it has there

python3 - "$config" <<'PYTHON'
import re, sys
text = open(sys.argv[1]).read()
text = re.sub(r'(?s)\[tracker\].*?(?=\[output\])', '[tracker]\ndriver = "polhemus"\n\n', text)
open(sys.argv[1], "w").write(text + '\n[control]\ndriver = "dlpc350"\npoll_s = 1\n')
PYTHON
# A LIBERTY counts its stations from 1.
sed -i 's/^tracker_body = 0/tracker_body = 1/' /etc/veneer/scene.toml
play liberty
play light-engine
expect "a tracker is plugged in" tell liberty plug
expect "and a light engine" tell light-engine plug
expect "it starts with both" timeout 175 systemctl start veneerd
expect_within "$patience" "the tracker tracks" says 'LIBERTY.*tracking' get Tracker
expect_within "$patience" "the light engine says how it is" says 'DLPC350' get Projector
expect_within "$patience" "it shows a picture" shows_a_picture
with_devices=$(unit MainPID)
expect "the tracker is pulled out" tell liberty unplug
expect_within "$patience" "which is a fault" says '"tracker"' get Faults
expect "the light engine is pulled out" tell light-engine unplug
expect_within "$patience" "which is one too" says '"projector"' get Faults
expect "the tracker is plugged in again" tell liberty plug
expect_within "$patience" "its fault is over" fails says '"tracker"' get Faults
expect_within "$patience" "it tracks again" says 'LIBERTY.*tracking' get Tracker
expect "the light engine is plugged in again" tell light-engine plug
expect_within "$patience" "its fault is over" fails says '"projector"' get Faults
expect "all by one process" test "$(unit MainPID)" = "$with_devices"
expect "it stops in time" timeout 30 systemctl stop veneerd
stop liberty
stop light-engine
expect_end
