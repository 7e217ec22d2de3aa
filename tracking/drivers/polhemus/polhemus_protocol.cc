// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus_protocol.h"

#include <algorithm>
#include <chrono>
#include <string_view>

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

constexpr double kMetresPerCentimetre = 0.01;
/// Readable bytes in a row that no binary frame has by chance: 24 of 97 in 256 are 1 in 10^10.
constexpr int kTextRun = 24;

Command command(std::string_view text, Duration pause) {
  Command command;
  for (const char c : text) command.bytes.push_back(static_cast<std::byte>(c));
  command.pause = pause;
  return command;
}

bool is_readable(std::byte byte) {
  const auto c = std::to_integer<unsigned char>(byte);
  return (c >= 0x20 && c < 0x7F) || c == '\r' || c == '\n';
}

}  // namespace

std::vector<Command> PolhemusProtocol::start() const {
  return {
      command("P", milliseconds(50)),                // ends continuous output; one record comes
      command("F1\r", milliseconds(20)),             // binary
      command("U1\r", milliseconds(20)),             // centimetres
      command("O*,8,9,11,3,7\r", milliseconds(20)),  // what PolhemusFrame holds
      command("C\r", Duration{}),                    // continuous output
  };
}

std::optional<DeviceClock> PolhemusProtocol::clock() const {
  return DeviceClock{WrappingCounter{32}, 1 / PolhemusFrame::kFrames_hz};
}

Duration PolhemusProtocol::period() const { return from_seconds(1 / PolhemusFrame::kFrames_hz); }

void PolhemusProtocol::reset() {
  pending_.clear();
  text_run_ = 0;
  answers_in_text_ = false;
}

void PolhemusProtocol::skip_byte(std::byte byte) {
  ++counters_.skipped_bytes;
  text_run_ = is_readable(byte) ? text_run_ + 1 : 0;
  if (text_run_ >= kTextRun) answers_in_text_ = true;
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
      skip_byte(left.front());
      left = left.subspan(1);
      continue;
    }
    if (left.size() < PolhemusFrame::kBytes) break;
    const PolhemusFrame frame = decode(left.first(PolhemusFrame::kBytes));
    left = left.subspan(PolhemusFrame::kBytes);
    text_run_ = 0;
    RawSample& sample = samples.emplace_back();
    sample.sensor = frame.station;
    sample.ticks = frame.count;
    sample.sequence = frame.count;
    sample.position_m = kMetresPerCentimetre * frame.position_cm.cast<double>();
    sample.rotation = frame.rotation.cast<double>();
    sample.suspect = frame.error != PolhemusFrame::kNoError;
  }
  pending_.erase(pending_.begin(), pending_.end() - static_cast<std::ptrdiff_t>(left.size()));
}

}  // namespace veneer::tracking
