// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus_protocol.h"

#include <algorithm>
#include <chrono>

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

constexpr double kMetresPerCentimetre = 0.01;

}  // namespace

std::vector<Command> PolhemusProtocol::start() const {
  return {
      ascii_command("P", milliseconds(50)),     // ends continuous output; one record comes
      ascii_command("F1\r", milliseconds(20)),  // binary
      ascii_command("U1\r", milliseconds(20)),  // centimetres
      ascii_command("O*,8,9,11,3,7\r", milliseconds(20)),  // what PolhemusFrame holds
      ascii_command("C\r", Duration{}),                    // continuous output
  };
}

std::optional<DeviceClock> PolhemusProtocol::clock() const {
  const double milliseconds = 1e-3;
  return DeviceClock{
      WrappingCounter{32},
      model_ == PolhemusModel::kLiberty ? 1 / PolhemusFrame::kFrames_hz : milliseconds};
}

Duration PolhemusProtocol::period() const {
  constexpr double kPatriot_hz = 60;  // for how long a silence is one; nothing else depends on it
  return from_seconds(
      1 / (model_ == PolhemusModel::kLiberty ? PolhemusFrame::kFrames_hz : kPatriot_hz));
}

void PolhemusProtocol::reset() {
  pending_.clear();
  text_ = {};
}

void PolhemusProtocol::feed(std::span<const std::byte> bytes,
                            std::vector<RawSample>& samples,
                            std::vector<std::byte>& /*reply*/) {
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  std::span<const std::byte> left = pending_;
  while (!left.empty()) {
    if (!may_be_frame(left, model_)) {
      const std::array<char, 2> tag = tag_of(model_);
      if (left.size() > 2 && std::to_integer<char>(left[0]) == tag[0] &&
          std::to_integer<char>(left[1]) == tag[1]) {
        ++counters_.bad_frames;
      }
      ++counters_.skipped_bytes;
      text_.add(left.front());
      left = left.subspan(1);
      continue;
    }
    if (left.size() < PolhemusFrame::kBytes) break;
    const PolhemusFrame frame = decode(left.first(PolhemusFrame::kBytes));
    left = left.subspan(PolhemusFrame::kBytes);
    text_.end();
    RawSample& sample = samples.emplace_back();
    sample.sensor = frame.station;
    sample.ticks = model_ == PolhemusModel::kLiberty ? frame.count : frame.milliseconds;
    sample.sequence = frame.count;
    sample.position_m = kMetresPerCentimetre * frame.position_cm.cast<double>();
    sample.rotation = frame.rotation.cast<double>();
    sample.suspect = frame.error != PolhemusFrame::kNoError;
  }
  pending_.erase(pending_.begin(), pending_.end() - static_cast<std::ptrdiff_t>(left.size()));
}

}  // namespace veneer::tracking
