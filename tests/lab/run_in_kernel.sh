#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# run_in_kernel.sh WORK COMMAND...: boots Debian's kernel in an emulated machine, loads the modules
# that MODULES names ("vivid node_types=0x101", one a line), runs COMMAND there as root and ends with
# its exit status. For drivers that need devices which only a kernel of one's own can make up.
#
# The machine sees this machine's files read-only, at the same paths, and has no network and no disk;
# what it writes to /run, where TMPDIR is, is lost. WORK is a folder where the kernel is kept (100 MB, fetched once with
# apt) unless this machine runs one that has the modules. LAB_SECONDS bounds it all (default 150).
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
  local module=$1 path
  shift
  while read -r verb path _; do
    [[ $verb == insmod ]] || continue
    cp -n "$path" "$stage/root/modules/"
    path=$(basename "$path")
    grep -q "^$path" "$load_list" && continue
    if [[ ${path%.ko} == "$module" ]]; then echo "$path $*"; else echo "$path"; fi >>"$load_list"
  done < <(modprobe -d "$modules_root" -S "$release" --show-depends "$module") || true
  grep -q "^$module.ko" "$load_list" ||
    modprobe -d "$modules_root" -S "$release" --show-depends "$module" | grep -q '^builtin' ||
    fail "kernel $release has no module $module"
}
for module in virtio_pci 9pnet_virtio 9p; do want "$module"; done
while read -r module options; do
  # shellcheck disable=SC2086  # options are words
  if [[ -n $module ]]; then want "$module" $options; fi
done <<<"$MODULES"

printf '%q ' "$@" >"$stage/root/command"
cat >"$stage/root/init" <<'INIT'
#!/bin/busybox sh
PATH=/bin
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /files
mount -t proc none /proc
mount -t sysfs none /sys
mount -t devtmpfs none /dev
while read -r line; do insmod /modules/${line}; done </modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144,cache=loose,ro files /files || echo "lab: no files"
for folder in proc sys dev; do mount -o bind /$folder /files/$folder; done
mount -t tmpfs none /files/run
cp /command /files/run/command
chroot /files /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/run TMPDIR=/run /bin/sh /run/command
echo "lab-status $?"
poweroff -f
INIT
chmod +x "$stage/root/init"
(cd "$stage/root" && find . | cpio -o -H newc --quiet) >"$stage/initrd"

# Emulation alone: no KVM is to be counted on where tests run.
timeout "${LAB_SECONDS:-150}" qemu-system-x86_64 -machine q35 -accel tcg,thread=multi -cpu max -smp 2 -m 1024 \
  -nodefaults -no-reboot -display none -serial "file:$stage/console" \
  -kernel "$kernel" -initrd "$stage/initrd" -append "console=ttyS0 quiet panic=-1" \
  -virtfs local,path=/,mount_tag=files,security_model=none,readonly=on,multidevs=remap </dev/null ||
  echo "lab: the machine did not end by itself within ${LAB_SECONDS:-150} s" >&2
tr -d '\r' <"$stage/console" | { grep -v -e '^lab-status ' -e 'reboot: Power down$' || true; }
status=$(tr -d '\r' <"$stage/console" | sed -n 's/^lab-status //p')
[[ -n $status ]] || fail "the command in the emulated machine came to no end; see its output above"
exit "$status"
