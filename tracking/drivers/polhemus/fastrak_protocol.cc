// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/fastrak_protocol.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>

#include "base/result.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

constexpr double kMetresPerCentimetre = 0.01;
constexpr double kRecords_hz = 120;
constexpr std::byte kSpace{' '};
constexpr std::size_t kNumbersAt = FastrakRecord::kHeader;
/// Floats of single precision are as near to a unit quaternion as 1e-6; anything that is one at all
/// is within this.
constexpr float kLengthTolerance = 0.1F;

using Numbers = std::array<float, 7>;
static_assert(std::endian::native == std::endian::little);
static_assert(kNumbersAt + sizeof(Numbers) + 1 == FastrakRecord::kBytes);

bool is_letter(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

/// Whether `bytes` begin as a record does, as far as they go.
bool may_be_record(std::span<const std::byte> bytes) {
  for (std::size_t i = 0; i < std::min(bytes.size(), FastrakRecord::kHeader); ++i) {
    const char c = std::to_integer<char>(bytes[i]);
    const bool fits = i == 0   ? c == '0'
                      : i == 1 ? c >= '1' && c < '1' + FastrakRecord::kStations
                               : c == FastrakRecord::kNoError || is_letter(c);
    if (!fits) return false;
  }
  return true;
}

}  // namespace

std::array<std::byte, FastrakRecord::kBytes> encode(const FastrakRecord& record) {
  std::array<std::byte, FastrakRecord::kBytes> bytes{};
  bytes[0] = std::byte{'0'};
  bytes[1] = static_cast<std::byte>('0' + record.station);
  bytes[2] = static_cast<std::byte>(record.error);
  const Eigen::Vector3f& p = record.position_cm;
  const Eigen::Quaternionf& q = record.rotation;
  const Numbers numbers{p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()};
  std::memcpy(&bytes[kNumbersAt], numbers.data(), sizeof(numbers));
  bytes.back() = kSpace;
  return bytes;
}

std::optional<FastrakRecord> decode_record(std::span<const std::byte> bytes) {
  VENEER_CHECK(bytes.size() >= FastrakRecord::kBytes);
  if (!may_be_record(bytes) || bytes[FastrakRecord::kBytes - 1] != kSpace) return std::nullopt;
  Numbers n{};
  std::memcpy(n.data(), &bytes[kNumbersAt], sizeof(n));
  FastrakRecord record;
  record.station = std::to_integer<int>(bytes[1]) - '0';
  record.error = std::to_integer<char>(bytes[2]);
  record.position_cm = {n[0], n[1], n[2]};
  record.rotation = Eigen::Quaternionf(n[3], n[4], n[5], n[6]);
  // Written so that NaN fails.
  if (!(std::abs(record.rotation.norm() - 1) <= kLengthTolerance)) return std::nullopt;
  return record;
}

std::vector<Command> FastrakProtocol::start() const {
  return {
      ascii_command("c", milliseconds(50)),  // ends continuous output
      ascii_command("f", milliseconds(20)),  // binary; unlike the LIBERTY it minds the case
      ascii_command("u", milliseconds(20)),  // centimetres
      // What FastrakRecord holds, station by station.
      ascii_command("O1,2,11,0\r", milliseconds(20)),
      ascii_command("O2,2,11,0\r", milliseconds(20)),
      ascii_command("O3,2,11,0\r", milliseconds(20)),
      ascii_command("O4,2,11,0\r", milliseconds(20)),
      ascii_command("C", Duration{}),  // continuous output
  };
}

Duration FastrakProtocol::period() const {
  return from_seconds(FastrakRecord::kStations / kRecords_hz);
}

void FastrakProtocol::reset() {
  pending_.clear();
  text_ = {};
}

void FastrakProtocol::feed(std::span<const std::byte> bytes,
                           std::vector<RawSample>& samples,
                           std::vector<std::byte>& /*reply*/) {
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  std::span<const std::byte> left = pending_;
  while (!left.empty()) {
    const bool may_be = may_be_record(left);
    if (may_be && left.size() < FastrakRecord::kBytes) break;
    const auto record = may_be ? decode_record(left) : std::nullopt;
    if (!record) {
      if (may_be) ++counters_.bad_frames;
      ++counters_.skipped_bytes;
      text_.add(left.front());
      left = left.subspan(1);
      continue;
    }
    left = left.subspan(FastrakRecord::kBytes);
    text_.end();
    RawSample& sample = samples.emplace_back();
    sample.sensor = record->station;
    sample.position_m = kMetresPerCentimetre * record->position_cm.cast<double>();
    sample.rotation = record->rotation.cast<double>();
    sample.suspect = record->error != FastrakRecord::kNoError;
  }
  pending_.erase(pending_.begin(), pending_.end() - static_cast<std::ptrdiff_t>(left.size()));
}

}  // namespace veneer::tracking
