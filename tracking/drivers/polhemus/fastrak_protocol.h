// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "tracking/device/protocol.h"
#include "tracking/drivers/polhemus/internal_ascii.h"

namespace veneer::tracking {

/// One binary record for the output list "2,11,0" (position, quaternion, a space), little-endian:
///
///     0 '0'   1 station, '1' to '4'   2 ' ', or the letter of an error
///     3 f32 x, y, z in centimetres   15 f32 w, x, y, z   31 ' '
///
/// The space at the end is asked for because it is one more byte that is known, in a record that
/// has neither size nor checksum. Source: the layouts read by VRPN's and by VESS's FASTRAK drivers.
struct FastrakRecord {
  int station = 1;
  char error = ' ';
  Eigen::Vector3f position_cm = Eigen::Vector3f::Zero();
  Eigen::Quaternionf rotation = Eigen::Quaternionf::Identity();

  static constexpr std::size_t kHeader = 3;
  static constexpr std::size_t kBytes = 32;
  static constexpr char kNoError = ' ';
  static constexpr int kStations = 4;
};

/// The record as the device sends it.
[[nodiscard]] std::array<std::byte, FastrakRecord::kBytes> encode(const FastrakRecord& record);
/// @param bytes  the first kBytes are looked at. Nothing where they are no record: a header or end
///     that is none, or a quaternion whose length is not about 1.
[[nodiscard]] std::optional<FastrakRecord> decode_record(std::span<const std::byte> bytes);

/// FASTRAK, binary continuous output. Sensor n is station n, the frame of reference is that of the
/// transmitter, positions come in centimetres and leave in metres. It counts nothing and has no
/// clock: what counts is the arrival.
///
/// What is no record is skipped byte by byte, so that no true record is lost to a false one. Its
/// ASCII records begin as the binary ones do; read as a quaternion, text has no length to speak of,
/// so that it is told from them.
class FastrakProtocol final : public Protocol {
 public:
  [[nodiscard]] std::vector<Command> start() const override;
  [[nodiscard]] std::optional<DeviceClock> clock() const override { return std::nullopt; }
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override { return std::nullopt; }
  /// 120 records a second are shared by the stations; that of all four.
  [[nodiscard]] Duration period() const override;
  void reset() override;
  void feed(std::span<const std::byte> bytes,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  [[nodiscard]] bool wants_restart() const override { return text_.found(); }
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  std::vector<std::byte> pending_;  // the beginning of a record
  TextRun text_;
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
