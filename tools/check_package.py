#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Looks at a Debian package of Veneer as it will be unpacked: usage check_package.py FILE.deb.
Prints what is wrong and exits 1 if anything is. lintian's errors count where there is a lintian."""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

NEEDED = (
    "./etc/veneer/veneer.toml",
    "./usr/bin/veneer",
    "./usr/bin/veneerd",
    "./usr/lib/systemd/system/veneerd.service",
    "./usr/lib/sysusers.d/veneer.conf",
    "./usr/lib/udev/rules.d/60-veneer-cameras.rules",
    "./usr/lib/udev/rules.d/60-veneer-instruments.rules",
    "./usr/lib/udev/rules.d/60-veneer-projectors.rules",
    "./usr/lib/udev/rules.d/60-veneer-trackers.rules",
    "./usr/share/bash-completion/completions/veneer",
    "./usr/share/doc/veneer/changelog.gz",
    "./usr/share/doc/veneer/copyright",
    "./usr/share/man/man1/veneer.1.gz",
    "./usr/share/man/man5/veneer.toml.5.gz",
    "./usr/share/man/man8/veneerd.8.gz",
    "./usr/share/veneer/demo/veneer.toml",
)
FOLDERS = re.compile(r"\./(etc/veneer|usr/(bin|lib/(systemd/system|sysusers\.d|udev/rules\.d)|share))/")
ENTRY = re.compile(r"(\S)(\S{9}) (\S+) +(\d+) \S+ \S+ (.*)")
# Libraries that have to be among the dependencies that dpkg-shlibdeps finds: one of each kind.
LIBRARIES = ("libc6", "libsdl2-2.0-0", "libhidapi-hidraw0", "libudev1", "libusb-1.0-0", "libegl1")


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def listing_problems(listing):
    """What is wrong with the lines of dpkg-deb --contents."""
    names = set()
    for line in listing.splitlines():
        kind, mode, owner, _, name = ENTRY.fullmatch(line).groups()
        names.add(name)
        if owner != "root/root":
            yield f"{name} belongs to {owner}"
        executable = kind == "d" or name.startswith("./usr/bin/")
        if kind == "l":
            yield f"{name} is a link"
        elif mode != ("rwxr-xr-x" if executable else "rw-r--r--"):
            yield f"{name} has mode {mode}"
        if kind != "d" and not FOLDERS.match(name):
            yield f"{name} is in a folder that is not ours"
    for name in NEEDED:
        if name not in names:
            yield f"{name} is missing"


def control_problems(fields, scripts, conffiles):
    """What is wrong with the control file, the scripts (name -> text) and the list of conffiles."""
    for field in ("Version", "Maintainer", "Description", "Depends", "Recommends", "Section"):
        if not fields.get(field):
            yield f"the control file has no {field}"
    depends = re.findall(r"[a-z0-9][a-z0-9.+-]*(?= ?[(,|]|$)", fields.get("Depends", ""))
    for library in LIBRARIES:
        if library not in depends:
            yield f"it does not depend on {library}"
    if conffiles.split() != ["/etc/veneer/veneer.toml"]:
        yield f"its conffiles are {conffiles.split()}"
    for name in ("postinst", "prerm", "postrm"):
        text = scripts.get(name, "")
        if "set -e" not in text:
            yield f"{name} is absent or goes on after an error"
        done = re.sub(r'^ *echo "[^"]*"$', "", text, flags=re.MULTILINE)  # what is said is not done
        if re.search(r"\b(start|enable|restart)\b[^\n]*veneerd|deb-systemd", done):
            yield f"{name} starts the service, which has nothing to show yet or shows something now"
    if "systemd-sysusers" not in scripts.get("postinst", ""):
        yield "postinst does not make the user"


def problems(package):
    yield from listing_problems(run("dpkg-deb", "--contents", package))
    with tempfile.TemporaryDirectory() as folder:
        run("dpkg-deb", "--control", package, folder)
        files = {path.name: path.read_text() for path in pathlib.Path(folder).iterdir()}
    fields = dict(re.findall(r"^(\S+): (.*)$", files["control"], re.MULTILINE))
    yield from control_problems(fields, files, files.get("conffiles", ""))
    if shutil.which("lintian"):
        found = subprocess.run(
            ["lintian", "--allow-root", "--fail-on", "none", package],
            capture_output=True, text=True, check=False,
        )
        yield from (line for line in found.stdout.splitlines() if line.startswith("E:"))


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    found = list(problems(sys.argv[1]))
    for problem in found:
        print(problem)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
