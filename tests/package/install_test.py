#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is installed, from a build: usage install_test.py BUILD. Installs it below a temporary folder
as a system would have it, and looks at it with the tools that will read it."""

import os
import pathlib
import re
import stat
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv.pop(1) if len(sys.argv) > 1 else ROOT / "build").resolve()

EXPECTED = (
    "etc/veneer/veneer.toml",
    "usr/bin/veneer",
    "usr/bin/veneerd",
    "usr/lib/systemd/system/veneerd.service",
    "usr/lib/sysusers.d/veneer.conf",
    "usr/lib/udev/rules.d/60-veneer-projectors.rules",
    "usr/lib/udev/rules.d/60-veneer-trackers.rules",
    "usr/share/bash-completion/completions/veneer",
    "usr/share/doc/veneer/LICENSE",
    "usr/share/doc/veneer/README.md",
    "usr/share/doc/veneer/howto/install.md",
    "usr/share/fish/vendor_completions.d/veneer.fish",
    "usr/share/man/man1/veneer-fit.1.gz",
    "usr/share/man/man1/veneer.1.gz",
    "usr/share/man/man5/veneer.toml.5.gz",
    "usr/share/man/man8/veneerd.8.gz",
    "usr/share/veneer/demo/scene.toml",
    "usr/share/veneer/scenarios/steady-walk.toml",
    "usr/share/zsh/vendor-completions/_veneer",
)


def run(*command, **options):
    return subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False, **options
    )


class InstallTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        cls.install()
        cls.usr = cls.root / "usr"
        cls.veneer = cls.usr / "bin/veneer"

    @classmethod
    def install(cls):
        found = run(
            "cmake", "--install", BUILD, "--prefix", "/usr", env={**os.environ, "DESTDIR": str(cls.root)}
        )
        if found.returncode != 0:
            raise AssertionError(found.stdout + found.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def help(self, *words):
        found = run(self.veneer, *words, "--help")
        self.assertEqual(found.returncode, 0, found.stderr)
        return found.stdout

    def commands(self):
        return re.findall(r"^  (\w+) +\S", self.help(), re.MULTILINE)

    def test_all_is_there_with_modes_for_all_to_read(self):
        for name in EXPECTED:
            self.assertTrue((self.root / name).is_file(), name)
        policy = "etc/dbus-1/org.veneer.Veneer1.conf"
        installed = self.usr / "share/dbus-1/system.d/org.veneer.Veneer1.conf"
        self.assertEqual(installed.exists(), (ROOT / policy).exists())
        for path in self.root.rglob("*"):
            mode = stat.S_IMODE(path.stat().st_mode)
            runs = path.is_dir() or path.parent.name == "bin"
            self.assertEqual(mode, 0o755 if runs else 0o644, path)

    def test_no_file_needs_the_place_where_it_was_built(self):
        for path in self.root.rglob("*"):
            if not path.is_file():
                continue
            if path.parent.name == "bin":
                # Messages of checks may name a source file; libraries are never looked for there.
                self.assertNotRegex(run("readelf", "-d", path).stdout, "RPATH|RUNPATH", path)
            else:
                self.assertNotIn(str(ROOT).encode(), path.read_bytes(), path)

    def test_programs_find_the_examples_beside_them(self):
        # The demo copies its configuration before anything that takes long, and then runs out of
        # room for what it writes: it has been told to write below a file.
        found = run(self.veneer, "capture", "demo", "--quiet", "-o", "/dev/null/out")
        self.assertNotEqual(found.returncode, 0)
        self.assertNotIn("share/veneer", found.stderr, "it did not find its rig")
        hidden = self.usr / "share/hidden"
        (self.usr / "share/veneer").rename(hidden)
        try:
            found = run(self.veneer, "capture", "demo", "--quiet", "-o", "/dev/null/out")
        finally:
            hidden.rename(self.usr / "share/veneer")
        self.assertIn("corrugated-rig.toml", found.stderr, "where nothing is, it says what it misses")

    def test_a_second_installation_keeps_the_configuration(self):
        configuration = self.root / "etc/veneer/veneer.toml"
        before = configuration.read_text()
        configuration.write_text(before + "# changed here\n")
        self.install()
        self.assertTrue(configuration.read_text().endswith("# changed here\n"))
        configuration.write_text(before)

    def test_a_fresh_service_says_what_it_needs(self):
        configuration = self.root / "etc/veneer/veneer.toml"
        found = run(self.usr / "bin/veneerd", "--config", configuration, "--quiet", timeout=60)
        self.assertEqual(found.returncode, 1, found.stderr)
        for needed in ("scene.toml", "material.safetensors", "veneer fit", "veneer calibrate"):
            self.assertIn(needed, found.stderr)

    def pages(self):
        return sorted((self.usr / "share/man").glob("man*/*.gz"))

    def shown(self, page):
        environment = {**os.environ, "LC_ALL": "C.UTF-8", "MANWIDTH": "1000"}
        found = run("man", "--warnings", "-P", "cat", "-l", page, env=environment)
        self.assertEqual(found.returncode, 0, page)
        self.assertEqual(found.stderr, "", page)
        return re.sub(r".\x08", "", found.stdout)

    def test_pages_are_clean(self):
        self.assertGreater(len(self.pages()), len(self.commands()))
        for page in self.pages():
            self.assertIn("NAME", self.shown(page))

    def test_every_command_and_option_has_its_place_in_a_page(self):
        overview = self.shown(self.usr / "share/man/man1/veneer.1.gz")
        options = 0
        for command in self.commands():
            self.assertRegex(overview, rf"(?m)^ +{command}\b")
            page = self.shown(self.usr / f"share/man/man1/veneer-{command}.1.gz")
            for option in self.options_of(command):
                options += 1
                self.assertRegex(page, rf"(?m)^ +(-\w, )?{option}\b", f"{command} {option}")
        self.assertGreater(options, 100)
        daemon = run(self.usr / "bin/veneerd", "--help").stdout
        page = self.shown(self.usr / "share/man/man8/veneerd.8.gz")
        for option in re.findall(r"^  (?:-\w,)?(--[\w-]+)", daemon, re.MULTILINE):
            self.assertRegex(page, rf"(?m)^ +(-\w, )?{option}\b")
        self.assertNotIn("--manual", page)

    def options_of(self, command):
        """Every option that the help of a command, and of the commands and tasks below it, shows."""
        text = self.help(command)
        for below in re.findall(r"^Subcommands:\n((?:  .*\n)+)", text, re.MULTILINE):
            for name in re.findall(r"^  ([\w-]+)", below, re.MULTILINE):
                text += self.help(command, name)
        for name in re.findall(rf"^  veneer {command} ([\w-]+) --help: ", text, re.MULTILINE):
            text += self.help(command, name)
        return set(re.findall(r"^  (?:-\w,)?(--[\w-]+)", text, re.MULTILINE))

    def completed(self, words):
        """What a real bash offers for the last word."""
        script = self.usr / "share/bash-completion/completions/veneer"
        array = " ".join(f"'{word}'" for word in words)
        found = run(
            "bash", "--norc", "-uc",
            f"source '{script}'; COMP_WORDS=({array}); COMP_CWORD={len(words) - 1}; _veneer; "
            'printf "%s\\n" "${COMPREPLY[@]}"; complete -p veneer',
        )
        self.assertEqual((found.returncode, found.stderr), (0, ""))
        *offered, registered = found.stdout.splitlines()
        self.assertIn("-F _veneer veneer", registered)
        return {word for word in offered if word}

    def test_bash_completes_every_command_and_option(self):
        commands = self.commands()
        self.assertEqual(self.completed(["veneer", ""]) - {"--help", "-h"}, set(commands))
        self.assertEqual(self.completed(["veneer", "doc"]), {"doctor"})
        for command in commands:
            own = set(re.findall(r"^  (?:-\w,)?(--[\w-]+)", self.help(command), re.MULTILINE))
            self.assertLessEqual(own, self.completed(["veneer", command, "--"]), command)
        self.assertIn("--reference-body", self.completed(["veneer", "track", "latency", "--ref"]))
        self.assertEqual(self.completed(["veneer", "completion", ""]) & {"bash", "fish", "zsh"},
                         {"bash", "fish", "zsh"})
        self.assertEqual(self.completed(["veneer", "capture", "--response", "d"]), {"debevec"})
        # A file: left to bash.
        self.assertEqual(self.completed(["veneer", "fit", "--output", ""]), set())

    def test_other_shells_take_their_scripts(self):
        for shell, script, check in (
            ("zsh", "zsh/vendor-completions/_veneer", ("zsh", "-n")),
            ("fish", "fish/vendor_completions.d/veneer.fish", ("fish", "--no-config", "-n")),
        ):
            if run("sh", "-c", f"command -v {shell}").returncode != 0:
                continue
            found = run(*check, self.usr / "share" / script)
            self.assertEqual((found.returncode, found.stderr), (0, ""), shell)
        if run("sh", "-c", "command -v fish").returncode == 0:
            script = self.usr / "share/fish/vendor_completions.d/veneer.fish"
            found = run("fish", "--no-config", "-c",
                        f"source {script}; complete -C 'veneer doc'; complete -C 'veneer fit --mod'; "
                        "complete -C 'veneer completion '")
            for word in ("doctor", "--model", "zsh"):
                self.assertIn(word, found.stdout)


if __name__ == "__main__":
    unittest.main()
