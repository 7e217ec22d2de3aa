#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The programs under the system calls that the unit leaves them: usage sandbox_test.py BUILD. The
filter is put up by libseccomp, as systemd does it, from the unit's own lines."""

import ctypes
import errno
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv.pop(1) if len(sys.argv) > 1 else ROOT / "build").resolve()
UNIT = ROOT / "etc/systemd/veneerd.service"
ALLOW = 0x7FFF0000  # SCMP_ACT_ALLOW
REFUSE = 0x00050000 | errno.EPERM  # SCMP_ACT_ERRNO


def members(name):
    """System calls of a group "@name", and of the groups in it."""
    if not name.startswith("@"):
        return {name}
    said = subprocess.run(
        ["systemd-analyze", "syscall-filter", name], capture_output=True, text=True, check=True
    ).stdout
    calls = set()
    for line in said.splitlines()[1:]:
        word = line.strip()
        if word and not word.startswith("#"):
            calls |= members(word)
    return calls


def calls_left():
    """What the unit's lines SystemCallFilter leave, in their order."""
    # systemd lets these through in every list that allows.
    calls = members("@default")
    lines = [line for line in UNIT.read_text().splitlines() if line.startswith("SystemCallFilter=")]
    for line in lines:
        value = line.split("=", 1)[1]
        named = set().union(*(members(word) for word in value.lstrip("~").split()))
        calls = calls - named if value.startswith("~") else calls | named
    return lines, calls


def enter(calls):
    """Puts this process, and what it starts, under a filter that allows these calls alone."""
    seccomp = ctypes.CDLL("libseccomp.so.2", use_errno=True)
    seccomp.seccomp_init.restype = ctypes.c_void_p
    context = ctypes.c_void_p(seccomp.seccomp_init(ctypes.c_uint32(REFUSE)))
    for call in sorted(calls):
        number = seccomp.seccomp_syscall_resolve_name(call.encode())
        if number >= 0:
            seccomp.seccomp_rule_add(context, ctypes.c_uint32(ALLOW), number, 0)
    if seccomp.seccomp_load(context) != 0:
        raise OSError("the filter cannot be loaded")


class SandboxTest(unittest.TestCase):
    def under_filter(self, calls, *command):
        return subprocess.run(
            [str(word) for word in command],
            capture_output=True, text=True, check=False, timeout=200,
            preexec_fn=lambda: enter(calls),
        )

    def test_the_filter_takes_away_what_it_says(self):
        lines, calls = calls_left()
        self.assertGreater(len(lines), 1)
        self.assertIn("ioctl", calls)
        for taken in ("setuid", "mount", "sched_setscheduler", "ptrace", "bpf", "reboot"):
            self.assertNotIn(taken, calls)
        script = "import os\ntry: os.sched_setaffinity(0, {0})\nexcept PermissionError: print('refused')"
        found = self.under_filter(calls, sys.executable, "-c", script)
        self.assertEqual(found.stdout, "refused\n", found.stderr)

    def test_veneerd_draws_as_well_as_without_it(self):
        _, calls = calls_left()
        with tempfile.TemporaryDirectory() as folder:
            found = self.under_filter(
                calls, BUILD / "bin/veneer", "harness", "run", ROOT / "etc/scenarios/steady-walk.toml",
                "--out", folder,
            )
            self.assertEqual(found.returncode, 0, found.stdout + found.stderr)
            self.assertIn("steady-walk: passed", found.stdout)


if __name__ == "__main__":
    unittest.main()
