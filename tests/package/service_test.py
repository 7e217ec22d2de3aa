#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The unit, the user and the udev rules, looked at by systemd's own tools and against each other."""

import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
UNIT = ROOT / "etc/systemd/veneerd.service"
SYSUSERS = ROOT / "etc/sysusers.d/veneer.conf"
RULES = sorted((ROOT / "etc/udev").glob("*.rules"))
MOST_EXPOSURE = 2.0  # of systemd-analyze security; "OK" in its words begins below 5


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False)


def unit_options():
    """(section, key) -> values, in order."""
    options, section = {}, None
    for line in UNIT.read_text().splitlines():
        if line.startswith("["):
            section = line.strip("[]")
        elif line and not line.startswith("#"):
            key, value = line.split("=", 1)
            options.setdefault((section, key), []).append(value)
    return options


class UnitTest(unittest.TestCase):
    def test_verify_has_nothing_to_say(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            shutil.copytree("/lib/systemd/system", root / "lib/systemd/system", symlinks=True)
            shutil.copy(UNIT, root / "lib/systemd/system")
            for program in ("usr/bin/veneerd", "bin/kill"):
                (root / program).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy("/bin/true", root / program)
            verify = ("systemd-analyze", "verify", "--man=no", f"--root={root}", "veneerd.service")
            found = run(*verify)
            self.assertEqual((found.returncode, found.stdout, found.stderr), (0, "", ""))
            # That it would have said something.
            unit = root / "lib/systemd/system/veneerd.service"
            unit.write_text(unit.read_text().replace("WatchdogSec=10", "WatchdogSec=often"))
            self.assertIn("often", run(*verify).stderr)

    def test_exposure_is_low(self):
        def exposure(unit):
            found = run("systemd-analyze", "security", "--offline=true", "--no-pager", str(unit))
            self.assertEqual(found.stderr, "")
            said = re.search(r"Overall exposure level for \S+: ([\d.]+)", found.stdout)
            self.assertIsNotNone(said, found.stdout)
            return float(said[1])

        self.assertLessEqual(exposure(UNIT), MOST_EXPOSURE)
        with tempfile.TemporaryDirectory() as folder:
            open_unit = pathlib.Path(folder) / UNIT.name
            open_unit.write_text("[Service]\nExecStart=/usr/bin/veneerd\n")
            self.assertGreater(exposure(open_unit), 9)

    def test_it_never_gives_up_but_on_a_mistake_of_the_configuration(self):
        options = unit_options()
        self.assertEqual(options["Service", "Restart"], ["on-failure"])
        self.assertEqual(options["Unit", "StartLimitIntervalSec"], ["0"])
        self.assertEqual(options["Service", "RestartPreventExitStatus"], ["2"])

    def test_what_is_kept_from_one_process_to_the_next_ends_with_the_service(self):
        options = unit_options()
        self.assertEqual(options["Service", "RuntimeDirectory"], ["veneer"])
        self.assertEqual(options["Service", "RuntimeDirectoryPreserve"], ["restart"])

    def test_only_private_networks_are_in_reach(self):
        options = unit_options()
        self.assertEqual(options["Service", "IPAddressDeny"], ["any"])
        allowed = set(" ".join(options["Service", "IPAddressAllow"]).split())
        private = {"10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "fc00::/7"}
        self.assertEqual(allowed, private | {"localhost", "link-local"})

    def test_its_environment_is_its_own(self):
        for value in unit_options().get(("Service", "Environment"), []):
            self.assertTrue(value.startswith("VENEER_"), value)


class UserTest(unittest.TestCase):
    def made(self):
        """The passwd and group files that systemd makes from the description on an empty machine."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "etc").mkdir()
            made = run("systemd-sysusers", f"--root={root}", str(SYSUSERS))
            self.assertEqual(made.returncode, 0, made.stderr)
            lines = [(root / "etc" / name).read_text() for name in ("passwd", "group")]
        return [[line.split(":") for line in text.splitlines()] for text in lines]

    def test_the_user_cannot_log_in_and_is_in_the_groups_of_the_devices(self):
        passwd, group = self.made()
        veneer = next(entry for entry in passwd if entry[0] == "veneer")
        self.assertEqual(veneer[5:], ["/var/lib/veneer", "/usr/sbin/nologin"])
        self.assertLess(int(veneer[2]), 1000)
        members = {entry[0] for entry in group if "veneer" in entry[3].split(",")}
        self.assertEqual(members, {"video", "render", "plugdev"})
        own = next(entry for entry in group if entry[0] == "veneer")
        self.assertEqual(own[2], veneer[3])

    def test_the_unit_runs_as_this_user(self):
        options = unit_options()
        self.assertEqual(options["Service", "User"], ["veneer"])
        self.assertEqual(options["Service", "StateDirectory"], ["veneer"])


class RulesTest(unittest.TestCase):
    # What udev 252 knows, of what our rules use: key, whether it takes {name}, and its operators.
    KEYS = {
        "ACTION": (False, "=="), "SUBSYSTEM": (False, "=="), "ENV": (True, "=="),
        "ATTR": (True, "=="), "ATTRS": (True, "=="), "GOTO": (False, "="), "LABEL": (False, "="),
        "MODE": (False, "="), "GROUP": (False, "="), "TAG": (False, "+="),
    }
    TOKEN = re.compile(r'([A-Z]+)(?:\{([^}]+)\})?(==|!=|\+=|=)"([^"]*)"')

    def rules(self, path):
        """Each rule as a list of (key, name, operator, value)."""
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if not line or line.startswith("#"):
                continue
            rest, tokens = line, []
            while rest:
                token = self.TOKEN.match(rest)
                self.assertIsNotNone(token, f"{path.name}:{number}: {rest}")
                tokens.append(token.groups())
                rest = rest[token.end():].removeprefix(",").lstrip()
            yield number, tokens

    def test_every_rule_is_one(self):
        self.assertGreater(len(RULES), 3)
        for path in RULES:
            labels, jumps = set(), set()
            for number, tokens in self.rules(path):
                for key, name, operator, value in tokens:
                    where = f"{path.name}:{number}: {key}"
                    self.assertIn(key, self.KEYS, where)
                    takes_name, operators = self.KEYS[key]
                    self.assertEqual(name is not None, takes_name, where)
                    self.assertEqual(operator, operators, where)
                    self.assertNotEqual(value, "", where)
                    if key == "LABEL":
                        labels.add(value)
                    if key == "GOTO":
                        jumps.add(value)
            self.assertEqual(labels, jumps, path.name)

    def test_devices_go_to_who_sits_there_and_to_the_service(self):
        groups = {line.split()[2] for line in SYSUSERS.read_text().splitlines() if line[:2] == "m "}
        grants = 0
        for path in RULES:
            for number, tokens in self.rules(path):
                given = {key: value for key, _, _, value in tokens}
                if "SUBSYSTEM" not in given:
                    continue
                where = f"{path.name}:{number}"
                grants += 1
                self.assertEqual(given.get("MODE"), "0660", where)
                self.assertIn(given.get("GROUP"), groups, where)
                self.assertEqual(given.get("TAG"), "uaccess", where)
                # Never a whole class of devices: something says whose they are.
                named = [t for t in tokens if t[0] in ("ATTR", "ATTRS") or t[1] == "ID_USB_INTERFACES"]
                self.assertTrue(named, where)
        self.assertGreater(grants, 4)

    def test_they_are_read_when_they_can_act(self):
        for path in RULES:
            self.assertTrue(50 < int(path.name[:2]) < 73, path.name)


if __name__ == "__main__":
    unittest.main()
