#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The scripts of the Debian package, run with programs that only note how they were called."""

import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEBIAN = ROOT / "cmake/debian"
PROGRAMS = ("systemctl", "systemd-sysusers", "udevadm")


def run(script, *arguments, active):
    """What it says, and the calls that it makes, on a machine with systemd."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "systemd").mkdir()
        for program in PROGRAMS:
            noting = folder / program
            noting.write_text(
                f'#!/bin/sh\necho "{program} $*" >>"{folder}/calls"\n'
                f'case $1 in is-active) exit {0 if active else 3} ;; esac\n'
            )
            noting.chmod(0o755)
        text = (DEBIAN / script).read_text().replace("/run/systemd/system", str(folder / "systemd"))
        done = subprocess.run(
            ["sh", "-c", text, script, *arguments],
            env={"PATH": f"{folder}:/usr/bin:/bin"}, capture_output=True, text=True, check=False,
        )
        assert done.returncode == 0 and done.stderr == "", done
        calls = folder / "calls"
        return done.stdout, calls.read_text().splitlines() if calls.exists() else []


def touches_the_service(call):
    return "veneerd" in call and "is-active" not in call


class PostinstTest(unittest.TestCase):
    def test_it_leaves_the_service_alone_whatever_runs(self):
        for version in ("", "0.1.0"):
            for active in (False, True):
                _, calls = run("postinst", "configure", version, active=active)
                self.assertIn("systemctl daemon-reload", calls)
                self.assertIn("systemd-sysusers veneer.conf", calls)
                self.assertEqual([call for call in calls if touches_the_service(call)], [])

    def test_it_says_how_a_new_version_is_started_only_where_an_old_one_runs(self):
        said, _ = run("postinst", "configure", "0.1.0", active=True)
        self.assertIn("goes on as version 0.1.0", said)
        self.assertIn("systemctl restart veneerd", said)
        for version, active in (("", True), ("", False), ("0.1.0", False)):
            said, _ = run("postinst", "configure", version, active=active)
            self.assertEqual(said, "", (version, active))

    def test_it_does_without_a_version(self):
        self.assertEqual(run("postinst", "configure", active=True)[0], "")


class PrermTest(unittest.TestCase):
    def test_only_a_removal_ends_the_service(self):
        ends = "systemctl disable --now veneerd.service"
        self.assertIn(ends, run("prerm", "remove", active=True)[1])

    def test_an_upgrade_does_not(self):
        self.assertEqual(run("prerm", "upgrade", "0.2.0", active=True)[1], [])


if __name__ == "__main__":
    unittest.main()
