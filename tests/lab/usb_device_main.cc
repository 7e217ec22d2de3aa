// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <iostream>
#include <string>

#include "base/exit_code.h"
#include "tests/lab/usb_devices.h"

// Plays a USB device in the kernel lab for as long as standard input lasts, for tests that are
// scripts. Each line of it is done and then answered with one: plug, unplug, value HEX (of a light
// engine).
namespace veneer::lab {
namespace {

template <class Do>
int serve(Do do_line) {
  for (std::string line; std::getline(std::cin, line);) {
    fmt::print("{}\n", do_line(line));
    std::fflush(stdout);
  }
  return kExitDone;
}

template <class Usb>
std::string plug_or_unplug(const std::string& line, Usb& usb) {
  const Status done = line == "plug" ? usb.plug() : usb.unplug();
  return done ? line : "error: " + done.error().what;
}

int main_of(const std::string& kind) {
  if (kind == "light-engine") {
    LightEngine engine;
    return serve([&](const std::string& line) {
      if (line.starts_with("value "))
        return fmt::format("{}", engine.value(std::stoi(line.substr(6), nullptr, 16)));
      return plug_or_unplug(line, engine.usb());
    });
  }
  if (kind == "colorhug") {
    ColorHug2 instrument;
    return serve([&](const std::string& line) { return plug_or_unplug(line, instrument.usb()); });
  }
  if (kind == "liberty") {
    Liberty liberty;
    return serve([&](const std::string& line) {
      if (line == "plug") return plug_or_unplug(line, liberty.usb());
      const Status done = liberty.unplug();
      return done ? line : "error: " + done.error().what;
    });
  }
  fmt::print(stderr, "usage: veneer_lab_usb_device light-engine|colorhug|liberty\n");
  return kExitUsage;
}

}  // namespace
}  // namespace veneer::lab

int main(int argc, char** argv) { return veneer::lab::main_of(argc == 2 ? argv[1] : ""); }
