// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/colorhug/colorhug.h"

#include <algorithm>
#include <array>
#include <utility>

#include "tracking/transports/hid.h"

namespace veneer::calibration {
namespace {

using colorhug::Command;
using colorhug::ReplyKind;
using colorhug::Report;
using tracking::IoStatus;
using tracking::UsbId;

constexpr std::string_view kUdevRule = "etc/udev/60-veneer-instruments.rules";
constexpr UsbId kColorHug2{0x273f, 0x1004};
constexpr std::array kBootLoaders{UsbId{0x273f, 0x1000}, UsbId{0x273f, 0x1005}};
constexpr std::array kFirstGeneration{UsbId{0x273f, 0x1001}, UsbId{0x04d8, 0xf8da}};
/// Reads after which a device that only ever says that it is busy is given up, whatever the time.
constexpr int kMostReads = 64;

/// Why it is not there as a ColorHug2, if it is there as something else.
Status check_bus() {
  VENEER_ASSIGN(const auto devices, tracking::list_devices(tracking::DeviceClass::kHidraw));
  const auto has = [&](UsbId id) {
    return std::ranges::find(devices, id, &tracking::BusDevice::id) != devices.end();
  };
  if (has(kColorHug2)) return {};
  for (const UsbId id : kBootLoaders)
    if (has(id))
      return fail(Errc::kUnavailable,
                  "opening the ColorHug2: it is in its boot loader ({}); plug it out and in again, "
                  "and if that does not help, load its firmware anew (colorhug-flash)",
                  text_of(id));
  for (const UsbId id : kFirstGeneration)
    if (has(id))
      return fail(Errc::kUnavailable,
                  "opening the ColorHug2: what is there ({}) is one of the first generation; set "
                  "driver to \"spotread\"",
                  text_of(id));
  return {};
}

}  // namespace

Status ColorHugOptions::check() const {
  if (calibration < 0 || calibration > colorhug::kLastCalibration)
    return fail(Errc::kInvalidOption,
                "opening the ColorHug2: calibration is {}; set it from 0 to {} ({} is the "
                "projector)",
                calibration,
                colorhug::kLastCalibration,
                colorhug::kCalibrationProjector);
  if (!corrected_from_read.allFinite())
    return fail(Errc::kInvalidOption, "opening the ColorHug2: the correction is not finite");
  if (time_limit <= Duration{})
    return fail(Errc::kInvalidOption, "opening the ColorHug2: the time limit is not above 0");
  return {};
}

ColorHug::ColorHug(const ColorHugOptions& options,
                   std::unique_ptr<tracking::Transport> transport,
                   Clock& clock)
    : options_(options), transport_(std::move(transport)), clock_(clock) {}

Result<std::unique_ptr<ColorHug>> ColorHug::open(const ColorHugOptions& options, Clock& clock) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_bus());
  tracking::HidModel model{{kColorHug2}, 0, std::nullopt, std::string(kUdevRule)};
  tracking::HidPort port("ColorHug2", std::move(model), options.identity, clock);
  VENEER_ASSIGN(auto transport, port.open());
  std::unique_ptr<ColorHug> device(new ColorHug(options, std::move(transport), clock));
  VENEER_ASSIGN(const Report version_reply, device->exchange(colorhug::firmware_version_request()));
  VENEER_ASSIGN(const auto version, colorhug::firmware_version(version_reply));
  VENEER_ASSIGN(const Report serial_reply, device->exchange(colorhug::serial_number_request()));
  VENEER_ASSIGN(const std::uint32_t serial, colorhug::serial_number(serial_reply));
  device->name_ = fmt::format("ColorHug2, serial number {}, firmware {}.{}.{}, calibration {}",
                              serial,
                              version.major,
                              version.minor,
                              version.micro,
                              options.calibration);
  return device;
}

std::string ColorHug::description() const { return name_; }

Result<Report> ColorHug::exchange(const Report& request) {
  // The report's number, 0 for none, goes before it.
  std::array<std::byte, colorhug::kReportSize + 1> bytes{};
  std::ranges::copy(request, bytes.begin() + 1);
  const IoStatus sent = transport_->write(bytes, clock_.now() + options_.time_limit);
  if (sent != IoStatus::kOk)
    return fail(Errc::kDisconnected,
                "reading a ColorHug: it takes no requests, so that it was unplugged; plug it in "
                "again");
  owes_a_reply_ = true;
  return wait_for_reply(static_cast<Command>(request[0]));
}

Result<Report> ColorHug::wait_for_reply(Command command) {
  const Time deadline = clock_.now() + options_.time_limit;
  std::array<std::byte, tracking::Transport::kLargestMessage> buffer{};
  for (int reads = 0; reads < kMostReads; ++reads) {
    const tracking::Received received = transport_->read(buffer, deadline);
    if (received.status == IoStatus::kTimeout) break;
    if (received.status != IoStatus::kOk)
      return fail(Errc::kDisconnected,
                  "reading a ColorHug: it was unplugged meanwhile; plug it in again");
    const std::span<const std::byte> reply(buffer.data(),
                                           std::min(received.bytes, colorhug::kReportSize));
    switch (colorhug::kind_of(reply, command)) {
      case ReplyKind::kStray:       // of a request that was given up
      case ReplyKind::kIncomplete:  // still busy
        continue;
      case ReplyKind::kFailed:
        owes_a_reply_ = false;
        return tl::unexpected<Error>(colorhug::failure_of(reply));
      case ReplyKind::kDone: {
        owes_a_reply_ = false;
        if (reply.size() != colorhug::kReportSize)
          return fail(Errc::kBadFormat,
                      "reading a ColorHug: its reply has {} bytes instead of {}; plug it out and "
                      "in again",
                      reply.size(),
                      colorhug::kReportSize);
        Report report{};
        std::ranges::copy(reply, report.begin());
        return report;
      }
    }
  }
  return fail(Errc::kTimeout,
              "reading a ColorHug: no reply within {:.1f} s; try again, and plug it out and in if "
              "this lasts",
              to_seconds(options_.time_limit));
}

Result<Xyz> ColorHug::read(Target /*target*/, const Eigen::Vector2d& /*pixel*/) {
  // A reading that was given up may still come, and would be taken for this one's. What the device
  // answers to another command comes after it.
  if (owes_a_reply_) {
    VENEER_TRY(exchange(colorhug::firmware_version_request()));
    VENEER_TRY(exchange(colorhug::serial_number_request()));
  }
  const auto calibration = static_cast<std::uint16_t>(options_.calibration);
  VENEER_ASSIGN(const Report reply, exchange(colorhug::take_reading_request(calibration)));
  VENEER_ASSIGN(const Xyz read, colorhug::reading_xyz(reply));
  return Xyz(options_.corrected_from_read * read);
}

}  // namespace veneer::calibration
