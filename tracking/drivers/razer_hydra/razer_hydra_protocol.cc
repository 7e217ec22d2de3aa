// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/razer_hydra/razer_hydra_protocol.h"

#include <array>

#include "tracking/drivers/internal_little_endian.h"

namespace veneer::tracking {
namespace {

constexpr std::array<std::size_t, 2> kControllers{8, 30};  // where their blocks begin
constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kQuaternionUnit = 1.0 / 32768;

}  // namespace

std::vector<Command> RazerHydraProtocol::start() const {
  Command command;
  command.kind = Command::Kind::kFeature;
  command.bytes.resize(91);
  command.bytes[6] = std::byte{1};
  command.bytes[8] = std::byte{4};
  command.bytes[9] = std::byte{3};   // motion; 0 would be the game pad
  command.bytes[89] = std::byte{6};  // exclusive or of the others
  command.pause = std::chrono::milliseconds(50);
  return {command};
}

void RazerHydraProtocol::feed(std::span<const std::byte> report,
                              std::vector<RawSample>& samples,
                              std::vector<std::byte>& /*reply*/) {
  if (report.size() != kReportBytes) {
    ++counters_.bad_frames;
    if (strange_run_ < kStrangeRun) ++strange_run_;
    return;
  }
  strange_run_ = 0;
  for (std::size_t i = 0; i < kControllers.size(); ++i) {
    const auto number = [&](std::size_t index) {
      return static_cast<double>(int16_at(report, kControllers[i] + 2 * index));
    };
    // Half a turn about x: y and z change their signs, of vectors and of quaternions alike.
    RawSample& sample = samples.emplace_back();
    sample.sensor = static_cast<int>(i) + 1;
    sample.position_m = kMetresPerMillimetre * Eigen::Vector3d(number(0), -number(1), -number(2));
    sample.rotation.w() = kQuaternionUnit * number(3);
    sample.rotation.vec() = kQuaternionUnit * Eigen::Vector3d(number(4), -number(5), -number(6));
    if (hemisphere_ && sample.position_m.dot(*hemisphere_) < 0) sample.position_m *= -1;
  }
}

}  // namespace veneer::tracking
