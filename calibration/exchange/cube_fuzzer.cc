// SPDX-License-Identifier: Apache-2.0
#include "base/testing/fuzzing.h"
#include "calibration/exchange/cube.h"

namespace veneer::calibration {
namespace {

/// A refusal has a text; what was read passes its own check, and can be written and read again.
Verdict read(std::string_view text) {
  const auto table = parse_cube(text, "fuzz");
  if (!table) return refused(table.error());
  if (!table->check()) return accepted("what was read does not pass");
  const auto written = cube_text(*table);
  if (!written) return accepted("what was read is not written: " + written.error().what);
  const auto again = parse_cube(*written, "fuzz");
  // Nine digits may bring the ends of a domain together.
  if (!again)
    return accepted(again.error().what.find("domain") != std::string::npos ? "" : "not read again");
  if (again->values.size() != table->values.size()) return accepted("values are lost");
  return accepted();
}

}  // namespace
}  // namespace veneer::calibration

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace calibration;
  static const FuzzedReader kReader{
      &read,
      {"TITLE \"t\"\nLUT_3D_SIZE 2\nDOMAIN_MIN 0 0 0\nDOMAIN_MAX 1 1 1\n0 0 0\n1 0 0\n0 1 0\n"
       "1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n",
       "LUT_1D_SIZE 2\r\nLUT_1D_INPUT_RANGE 0.0 1.0\r\n# c\r\n0 0 0\r\n1e0 .5 -1\r\n"},
      {512, 32}};
  return kReader;
}
