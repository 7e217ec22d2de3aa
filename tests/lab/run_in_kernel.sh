#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# run_in_kernel.sh WORK COMMAND...: boots Debian's kernel in an emulated machine, runs COMMAND there as
# root and ends with its exit status. For what only a kernel of one's own can make up: devices, a
# display, services.
#
# The machine sees this machine's files at the same paths; what it writes there is lost. It has no
# network and no disk. WORK is a folder where the kernel is kept (100 MB, fetched once with apt)
# unless this machine runs one that has the modules. The environment says what else it has:
#
#   MODULES      kernel modules with their options, "vivid node_types=0x101", one a line
#   LAB_INIT     shell (default): COMMAND alone; systemd: it is the first process, with D-Bus, a
#                journal and udev, and COMMAND is one of its units
#   LAB_OUT      a folder that is /run/lab there: what is written to it stays
#   LAB_SCREEN   WIDTHxHEIGHT: a display of that size (virtio-gpu). keep_screen.sh NAME, called there,
#                keeps what is scanned out in LAB_OUT. Below 640x480 it has no EDID, which knows no such
#                modes
#   LAB_SECONDS  bounds it all (default 150)
set -euo pipefail

fail() {
  printf 'lab: %s\n' "$*" >&2
  exit 1
}

(($# >= 2)) || fail "usage: run_in_kernel.sh WORK COMMAND..."
work=$(readlink -m "$1")
shift
for tool in qemu-system-x86_64:qemu-system-x86 busybox:busybox-static cpio:cpio depmod:kmod; do
  command -v "${tool%%:*}" >/dev/null ||
    fail "${tool%%:*} is missing; as root, run: apt-get install --no-install-recommends ${tool##*:}"
done
mkdir -p "$work"
MODULES=${MODULES:-}
LAB_INIT=${LAB_INIT:-shell}
LAB_SECONDS=${LAB_SECONDS:-150}

# A kernel with its modules: that of this machine's /boot, or Debian's own, unpacked in WORK.
find_kernel() {
  local image
  for image in "$1"/boot/vmlinuz-*; do
    [[ -r $image && -d $1/lib/modules/${image##*/vmlinuz-} ]] || continue
    release=${image##*/vmlinuz-}
    kernel=$image
    modules_root=$1
  done
  [[ -n ${kernel:-} ]]
}
if ! find_kernel "" && ! find_kernel "$work/kernel"; then
  command -v apt-get >/dev/null || fail "no kernel in /boot and no apt-get to fetch one with"
  package=$(apt-cache depends linux-image-amd64 2>/dev/null | awk '/Depends: linux-image-/ { print $2; exit }')
  [[ -n $package ]] || fail "apt knows no linux-image-amd64; as root, run: apt-get update"
  printf 'lab: fetching %s\n' "$package" >&2
  rm -rf "$work/fetch"
  mkdir -p "$work/fetch"
  # Root's downloads go through a user that may not write here; apt says so, and it is no error.
  (cd "$work/fetch" && apt-get download -q "$package" >&2) || fail "could not fetch $package"
  dpkg -x "$work"/fetch/*.deb "$work/fetch/kernel"
  rm -rf "$work/kernel"
  mv "$work/fetch/kernel" "$work/kernel"
  rm -rf "$work/fetch"
  find_kernel "$work/kernel" || fail "$package holds no kernel"
fi
[[ -f $modules_root/lib/modules/$release/modules.dep ]] || depmod -b "$modules_root" "$release"

# The first files of the machine: a shell, the modules in the order in which they need each other, and
# what to do.
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
mkdir -p "$stage/root/bin" "$stage/root/modules"
cp "$(command -v busybox)" "$stage/root/bin/busybox"
load_list=$stage/root/modules/order
: >"$load_list"
# want MODULE OPTION...: it and what it stands on; a module that is built in needs nothing.
want() {
  local module=$1 path name found=false
  shift
  while read -r verb path _; do
    [[ $verb == insmod ]] || continue
    cp -n "$path" "$stage/root/modules/"
    path=$(basename "$path")
    name=${path%.ko}
    # The file may be spelt with dashes where the module is not.
    if [[ ${name//-/_} == "$module" ]]; then found=true; fi
    grep -q "^$path" "$load_list" && continue
    if [[ ${name//-/_} == "$module" ]]; then echo "$path $*"; else echo "$path"; fi >>"$load_list"
  done < <(modprobe -d "$modules_root" -S "$release" --show-depends "$module")
  $found || modprobe -d "$modules_root" -S "$release" --show-depends "$module" 2>&1 | grep -q '^builtin' ||
    fail "kernel $release has no module $module"
}

# shellcheck disable=SC2054  # the emulator's commas
machine=(-machine q35 -accel tcg,thread=multi -cpu max -smp 2 -m 2048 -nodefaults -no-reboot -display none
  -virtfs "local,path=/,mount_tag=files,security_model=none,readonly=on,multidevs=remap")
for module in virtio_pci 9pnet_virtio 9p overlay; do want "$module"; done
if [[ -n ${LAB_OUT:-} ]]; then
  mkdir -p "$LAB_OUT"
  LAB_OUT=$(readlink -f "$LAB_OUT")
  machine+=(-virtfs "local,path=$LAB_OUT,mount_tag=out,security_model=none,multidevs=remap")
fi
if [[ -n ${LAB_SCREEN:-} ]]; then
  want virtio_gpu
  want virtio_console
  # The emulator's monitor is plugged into a port of its own machine, so that whoever shows a picture
  # there also says when it is to be kept.
  edid=on
  if ((${LAB_SCREEN%x*} < 640)); then edid=off; fi
  machine+=(-device "virtio-vga,xres=${LAB_SCREEN%x*},yres=${LAB_SCREEN#*x},edid=$edid"
    -chardev "socket,id=monitor,path=$stage/monitor,server=on,wait=off" -mon "chardev=monitor,mode=control"
    -chardev "socket,id=plug,path=$stage/monitor"
    -device virtio-serial-pci -device "virtserialport,chardev=plug,nr=1")
fi
while read -r module options; do
  # shellcheck disable=SC2086  # options are words
  if [[ -n $module ]]; then want "$module" $options; fi
done <<<"$MODULES"

printf '%q ' "$@" >"$stage/root/command"
cat >"$stage/root/init" <<INIT
#!/bin/busybox sh
PATH=/bin
init=$LAB_INIT
out=${LAB_OUT:-}
INIT
cat >>"$stage/root/init" <<'INIT'
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /files /over /new
mount -t proc none /proc
mount -t sysfs none /sys
mount -t devtmpfs none /dev
while read -r line; do insmod /modules/${line}; done </modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose,ro files /files || echo "lab: no files"
mount -t tmpfs none /over
mkdir /over/up /over/work
mount -t overlay -o lowerdir=/files,upperdir=/over/up,workdir=/over/work none /new || echo "lab: no overlay"
mount -t tmpfs none /new/run
if [ "$out" ]; then
  mkdir /new/run/lab
  mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=none out /new/run/lab || echo "lab: no out"
fi
mkdir -p /dev/pts /dev/shm
ln -sf /proc/self/fd /dev/fd
mount -t devpts none /dev/pts
mount -t tmpfs none /dev/shm
for folder in proc sys dev; do mount --move /$folder /new/$folder; done
environment="PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/run TMPDIR=/run LAB_OUT=$out"
{
  echo "env -i $environment /bin/sh /run/lab-command </dev/null"
  echo 'echo "lab-status $?"'
  # At once: there is nothing to be kept, and no file can be read any more.
  echo 'echo o >/proc/sysrq-trigger; while :; do :; done'
} >/new/run/lab-main
cp /command /new/run/lab-command
if [ "$init" = systemd ]; then
  mkdir -p /new/run/systemd/system
  cat >/new/run/systemd/system/lab.service <<'UNIT'
[Unit]
DefaultDependencies=no
Wants=dbus.service systemd-journald.service systemd-udevd.service
After=dbus.service systemd-journald.service systemd-udevd.service
[Service]
Type=oneshot
StandardOutput=tty
StandardError=tty
TTYPath=/dev/ttyS0
ExecStart=/bin/sh /run/lab-main
UNIT
  # What a machine does at its first start, and what waits for disks and networks: nothing is tested
  # with it here and it takes minutes.
  for unit in systemd-tmpfiles-setup systemd-tmpfiles-setup-dev systemd-journal-flush \
    systemd-hwdb-update systemd-journal-catalog-update systemd-machine-id-commit systemd-firstboot \
    systemd-random-seed systemd-update-utmp systemd-udev-trigger systemd-update-done \
    systemd-timesyncd systemd-resolved ldconfig; do
    ln -s /dev/null /new/run/systemd/system/$unit.service
  done
  rm -f /new/etc/machine-id /new/etc/fstab
  echo 0123456789abcdef0123456789abcdef >/new/etc/machine-id
  exec switch_root /new /lib/systemd/systemd --unit=lab.service --log-target=null --show-status=0
fi
exec switch_root /new /bin/sh /run/lab-main
INIT
chmod +x "$stage/root/init"
(cd "$stage/root" && find . | cpio -o -H newc --quiet) >"$stage/initrd"

# Emulation alone: no KVM is to be counted on where tests run. Where the machine around it is busy, its timer
# comes too late for the check that the kernel makes of it, and there it panics.
timeout "$LAB_SECONDS" qemu-system-x86_64 "${machine[@]}" -serial "chardev:console" \
  -chardev "file,id=console,path=$stage/console" \
  -kernel "$kernel" -initrd "$stage/initrd" -append "console=ttyS0 quiet panic=-1 no_timer_check" </dev/null ||
  echo "lab: the machine did not end by itself within $LAB_SECONDS s" >&2
tr -d '\r' <"$stage/console" | { grep -v -e '^lab-status ' -e 'sysrq: Power Off$' -e 'reboot: Power down$' || true; }
status=$(tr -d '\r' <"$stage/console" | sed -n 's/^lab-status //p')
[[ -n $status ]] || fail "the command in the emulated machine came to no end; see its output above"
exit "$status"
