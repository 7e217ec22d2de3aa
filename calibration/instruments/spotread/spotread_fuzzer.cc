// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "base/testing/fuzzing.h"
#include "calibration/instruments/spotread/spotread_output.h"

namespace veneer::calibration {
namespace {

bool is_printable(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
}

/// The first byte says in what pieces the rest comes. Texts are printable and of bounded length,
/// readings are numbers.
Verdict read(std::string_view text) {
  if (text.empty()) return refused("nothing");
  bool understood = false;
  const std::size_t piece = static_cast<unsigned char>(text[0]) + std::size_t{1};
  spotread::Output output;
  for (std::size_t at = 1; at < text.size(); at += piece) {
    output.feed(text.substr(at, piece));
    while (const auto event = output.next()) {
      understood = true;
      if (!event->xyz.allFinite()) return accepted("a reading is not finite");
      if (!is_printable(event->text)) return accepted("a text is not printable");
      if (event->text.size() > 2 * spotread::Output::kLongestLine)
        return accepted("a text has no bounds");
    }
    if (!is_printable(output.complaint())) return accepted("a complaint is not printable");
  }
  return understood ? accepted() : refused("nothing that spotread says");
}

}  // namespace
}  // namespace veneer::calibration

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace calibration;
  static const FuzzedReader kReader{
      &read,
      {"\x10\nPlace cap on the instrument, or place on a dark surface,\n and then hit any key to "
       "continue,\n or hit Esc or Q to abort: \nHit ESC or Q to exit, any other key to take a "
       "reading: \n Result is XYZ: 211.83 218.63 232.52, D50 Lab: 1 2 3\n",
       "\x03\nSpot read failed due to misread (x)\nHit Esc or Q to give up, any other key to "
       "retry:",
       "\xFFspotread: Error - No instrument at port 1\nany other key to use reading:"},
      {512, 8}};
  return kReader;
}
