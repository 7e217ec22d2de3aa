// SPDX-License-Identifier: Apache-2.0
#include "daemon/manual_page.h"

#include <CLI/CLI.hpp>

#include "base/manual/roff.h"

namespace veneer::daemon {

std::string manual_page(const CLI::App& app) {
  manual::Usage usage = manual::usage_of(app, "veneerd");
  usage.summary = "drive a projector so that an object looks as if it were of another material";
  manual::Page page;
  page.name = "veneerd";
  page.section = 8;
  page.sections = {
      {"Description",
       "veneerd follows the observer's eye, draws for every pixel of the projector the light that "
       "the material would send there, and corrects it for projector, surface and room. It runs "
       "until it is told to stop. The unit veneerd.service runs it as the user veneer; it is "
       "installed, but neither enabled nor started, since it needs a scene, a material and a "
       "profile first."},
      {"Signals",
       "*SIGHUP: read the configuration anew, and the scene, material and profile that it names. "
       "What is bad is refused, and what was shown stays. Keys that veneer.toml(5) marks are taken "
       "at "
       "the next start; a warning names those that differ.\n\n"
       "*SIGTERM, SIGINT: give the display back and end."},
      {"Exit status",
       "*0: told to stop, or all frames made that the configuration asks for\n\n"
       "*1: failed; standard error says what went wrong and what to do about it\n\n"
       "*2: wrong usage, or a mistake in the configuration; the unit does not start it again"},
      {"Environment",
       "*STATE_DIRECTORY: where snapshots, and the display's colour tables as they were found, are "
       "kept. systemd sets it.\n\n"
       "*RUNTIME_DIRECTORY: where it is kept that the dark was asked for, so that it is dark again "
       "after a crash. systemd sets it.\n\n"
       "*NOTIFY_SOCKET, WATCHDOG_USEC: how systemd is told that it is ready and that frames go "
       "out."},
      {"Files",
       "*/etc/veneer/veneer.toml: the configuration, veneer.toml(5)\n\n"
       "*/var/lib/veneer: scene, material, profile and state\n\n"
       "*/lib/udev/rules.d/60-veneer-*.rules: who may open trackers, light engines and "
       "colorimeters\n\n"
       "*/usr/share/doc/veneer/howto/install.md: from the installation to the first picture"}};
  page.see_also = {
      "veneer(1)", "veneer-calibrate(1)", "veneer.toml(5)", "systemctl(1)", "journalctl(1)"};
  return manual::to_roff(usage, page);
}

}  // namespace veneer::daemon
