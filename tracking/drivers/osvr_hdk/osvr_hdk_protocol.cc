// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/osvr_hdk/osvr_hdk_protocol.h"

#include "tracking/drivers/internal_little_endian.h"

namespace veneer::tracking {
namespace {

constexpr double kQuaternionUnit = 1.0 / 16384;
constexpr unsigned kOldestVersion = 1;
constexpr unsigned kNewestVersion = 3;

bool is_report(std::span<const std::byte> report) {
  if (report.size() != 16 && report.size() != 32) return false;
  const auto version = std::to_integer<unsigned>(report[0] & std::byte{0x0F});
  return version >= kOldestVersion && version <= kNewestVersion;
}

}  // namespace

void OsvrHdkProtocol::feed(std::span<const std::byte> report,
                           std::vector<RawSample>& samples,
                           std::vector<std::byte>& /*reply*/) {
  if (!is_report(report)) {
    ++counters_.bad_frames;
    return;
  }
  const auto number = [&](std::size_t index) {
    return kQuaternionUnit * int16_at(report, 2 + 2 * index);
  };
  RawSample& sample = samples.emplace_back();
  sample.sensor = 1;
  sample.sequence = std::to_integer<std::uint64_t>(report[1]);
  sample.position_m = position_m_;
  sample.rotation = Eigen::Quaterniond(number(3), number(0), number(1), number(2));
}

}  // namespace veneer::tracking
