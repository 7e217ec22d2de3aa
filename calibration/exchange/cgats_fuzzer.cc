// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/testing/fuzzing.h"
#include "calibration/exchange/cgats.h"

namespace veneer::calibration {
namespace {

/// A refusal is a text of printable characters; what was read can be written and read again.
std::string broken_by(const Result<MeasuredPatches>& ti3,
                      const Result<std::vector<Eigen::Vector3d>>& ti1,
                      const Result<ColorimeterCorrection>& ccmx) {
  const auto is_text = [](const Error& error) {
    for (const char c : error.what)
      if (c < ' ' || c > '~') return false;
    return !error.what.empty();
  };
  if (!ti3 && !is_text(ti3.error())) return "the refusal of a .ti3 is no text";
  if (!ti1 && !is_text(ti1.error())) return "the refusal of a .ti1 is no text";
  if (!ccmx && !is_text(ccmx.error())) return "the refusal of a .ccmx is no text";
  if (ccmx && !ccmx->corrected_from_read.allFinite()) return "a correction is not finite";
  if (!ti3) return "";
  double largest = 0;
  for (const PatchReading& patch : ti3->patches) {
    if (!patch.xyz.allFinite()) return "a reading is not finite";
    if (patch.drive.minCoeff() < 0 || patch.drive.maxCoeff() > 1) return "a drive is out of range";
    largest = std::max(largest, patch.drive.maxCoeff());
  }
  if (largest <= 0.01) return "";  // is not written
  const auto written = ti3_text(*ti3);
  if (!written) return "what was read is not written: " + written.error().what;
  const auto again = parse_ti3(*written, "fuzz");
  if (!again) return "what was written is not read: " + again.error().what;
  if (again->patches.size() != ti3->patches.size()) return "patches are lost";
  return "";
}

Verdict read(std::string_view text) {
  const auto ti3 = parse_ti3(text, "fuzz");
  const auto ti1 = parse_ti1(text, "fuzz");
  const auto ccmx = parse_ccmx(text, "fuzz");
  const std::string broken = broken_by(ti3, ti1, ccmx);
  if (ti3 || ti1 || ccmx || !broken.empty()) return accepted(broken);
  return refused(ti3.error());
}

}  // namespace
}  // namespace veneer::calibration

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace calibration;
  static const FuzzedReader kReader{
      &read,
      {"CTI3\n\nDESCRIPTOR \"test\"\nDEVICE_CLASS \"DISPLAY\"\nCOLOR_REP \"RGB_XYZ\"\n"
       "NORMALIZED_TO_Y_100 \"YES\"\nLUMINANCE_XYZ_CDM2 \"45 50 40\"\nNUMBER_OF_FIELDS 7\n"
       "BEGIN_DATA_FORMAT\nSAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\n"
       "NUMBER_OF_SETS 2\nBEGIN_DATA\n1 0 0 0 0.1 0.2 0.3\n2 100 50 25 90 100 80\nEND_DATA\n",
       "CTI1\nCOLOR_REP \"RGB\"\nNUMBER_OF_FIELDS 4\nBEGIN_DATA_FORMAT\n"
       "SAMPLE_ID RGB_R RGB_G RGB_B\nEND_DATA_FORMAT\nNUMBER_OF_SETS 1\nBEGIN_DATA\n"
       "1 10 20 30\nEND_DATA\n",
       "CCMX\nINSTRUMENT \"I\"\nDISPLAY \"D\"\nCOLOR_REP \"XYZ\"\nNUMBER_OF_FIELDS 3\n"
       "BEGIN_DATA_FORMAT\nXYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nNUMBER_OF_SETS 3\nBEGIN_DATA\n"
       "1 2 3\n0 5 6\n0 0 9\nEND_DATA\n"},
      {384 << 10, 64}};
  return kReader;
}
