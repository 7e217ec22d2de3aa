// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <string_view>

#include "base/testing/fuzzing.h"
#include "base/testing/law.h"
#include "projector/control/pjlink/pjlink_protocol.h"

namespace veneer::projector {
namespace {

/// A line of any bytes, taken for everything that a line may be.
Verdict read(std::string_view line) {
  const auto greeting = pjlink::read_greeting(line);
  has_text(greeting);
  if (greeting && greeting->seed) law(greeting->seed->size() == 8, "a seed of another length");
  const pjlink::Request request{1, "LAMP", "?"};
  const auto reply = pjlink::read_reply(line, request);
  has_text(reply);
  if (reply && reply->refusal != 0)
    law(!pjlink::error_of(*reply, request).what.empty(), "a refusal without a text");
  const std::string_view parameter = reply ? std::string_view(reply->parameter) : line;
  const auto lamps = pjlink::read_lamps(parameter);
  has_text(lamps);
  if (lamps) {
    law(!lamps->empty() && lamps->size() <= 8, "too many lamps, or none");
    law(std::ranges::all_of(*lamps, [](const Lamp& lamp) { return lamp.hours >= 0; }),
        "hours below zero");
  }
  const auto health = pjlink::read_health(parameter);
  has_text(health);
  if (health) law(health->size() == 6, "health of other than six parts");
  const auto size_told = pjlink::read_resolution(parameter);
  if (size_told) law(size_told->width > 0 && size_told->height > 0, "a picture without pixels");
  has_text(pjlink::read_power(parameter));
  has_text(pjlink::read_mute(parameter));
  has_text(pjlink::read_flag(parameter));
  const auto name = pjlink::input_name(parameter);
  has_text(name);
  if (name)
    law(pjlink::input_code(*name) == std::string(parameter), "an input's name is another's");
  has_text(pjlink::input_code(parameter));
  const auto mac = pjlink::read_acknowledgement(line);
  has_text(mac);
  if (mac) {
    const auto again = pjlink::read_acknowledgement("%2ACKN=" + *mac + "\r");
    law(again && *again == *mac, "another address");
  }
  const std::string text = pjlink::readable(line);
  law(text.size() <= line.size() && pjlink::readable(text) == text,
      "a text does not stay readable");
  if (greeting || reply || mac) return accepted();
  return refused(reply.error());
}

}  // namespace
}  // namespace veneer::projector

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace projector;
  static const FuzzedReader kReader{
      &read,
      {"PJLINK 0",
       "PJLINK 1 498e4a67",
       "%1LAMP=15 1 2000 0",
       "%1LAMP=ERR3",
       "%2ACKN=00:11:22:aa:BB:cc"},
      {2048, 16},
      {"%1LAMP=000120", "%1LAMP=1920x1080", "%1LAMP=3B", "%1LAMP=31", "PJLINK ERRA"}};
  return kReader;
}
