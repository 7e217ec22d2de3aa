// SPDX-License-Identifier: Apache-2.0
#include "tests/lab/usb_devices.h"

#include <chrono>
#include <utility>

#include "tracking/drivers/polhemus/polhemus_frame.h"

namespace veneer::lab {
namespace {

int at(const HidReport& report, std::size_t index) {
  return std::to_integer<int>(report.at(index));
}

HidReport report_of(std::initializer_list<int> values) {
  HidReport report{};
  std::size_t index = 0;
  for (const int value : values) report.at(index++) = static_cast<std::byte>(value);
  return report;
}

}  // namespace

LightEngine::LightEngine(std::string serial, HidGadget::Layout layout)
    : values_{{0x0200, {0}},
              {0x0205, {0, 0, 4, 4, 1, 0, 1, 4, 0, 0, 0, 0, 0, 0, 0, 0}},
              {0x071C, std::vector<int>(28, 2)},
              {0x0B01, {155, 135, 165}},
              {0x100A, {0}},
              {0x1A00, {0x08}},
              {0x1A05, {0}},
              {0x1A07, {0x08}},
              {0x1A0A, {1}},
              {0x1A0B, {1}},
              {0x1A0C, {0x0A}},
              {0x1A0E, {0x81}},
              {0x1A1B, {0}}},
      usb_({0x0451, 0x6401, "DLPC350", std::move(serial)},
           layout,
           [this](int interface, const HidReport& report) { return answer(interface, report); }) {}

int LightEngine::value(int command) const {
  const std::lock_guard lock(mutex_);
  const auto found = values_.find(command);
  return found == values_.end() ? -1 : found->second.front();
}

std::vector<HidReport> LightEngine::answer(int interface, const HidReport& report) {
  if (interface != 0) {
    ++strays_;
    return {};
  }
  if (silent_) return {};
  const bool is_read = (at(report, 0) & 0x80) != 0;
  const int command = at(report, 4) + 256 * at(report, 5);
  const std::lock_guard lock(mutex_);
  HidReport reply = report_of({is_read ? 0xC0 : 0x40, at(report, 1)});
  if (!is_read) {
    std::vector<int> value;
    for (int i = 0; i < at(report, 2) - 2 && i < 58; ++i)
      value.push_back(at(report, static_cast<std::size_t>(6 + i)));
    values_[command] = value;
    // What the device's own status says of it.
    int& status = values_[0x1A0C].front();
    if (command == 0x100A && !value.empty()) status = (status & ~4) | (value[0] != 0 ? 4 : 0);
    if (command == 0x1A0E && !value.empty())
      status = (status & ~8) | ((value[0] & 0x80) != 0 ? 8 : 0);
  } else if (const auto found = values_.find(command); found != values_.end()) {
    reply[2] = static_cast<std::byte>(found->second.size());
    for (std::size_t i = 0; i < found->second.size(); ++i)
      reply.at(4 + i) = static_cast<std::byte>(found->second[i]);
  } else {
    reply[0] |= std::byte{0x20};  // NACK
  }
  return {reply};
}

ColorHug2::ColorHug2()
    : usb_({0x273f, 0x1004, "ColorHug2", ""}, {}, [this](int, const HidReport& report) {
        return answer(report);
      }) {}

std::vector<HidReport> ColorHug2::answer(const HidReport& report) const {
  const auto byte = [](std::int32_t value, int index) { return (value >> (8 * index)) & 0xFF; };
  switch (at(report, 0)) {
    case 0x07:
      return {report_of({0, 0x07, 2, 0, 0, 0, 7, 0})};
    case 0x0B:
      return {report_of({0, 0x0B, 0x39, 0x30, 0, 0})};
    case 0x23: {
      if (busy_) return {report_of({0x12, 0x23})};
      return {report_of({0,
                         0x23,
                         byte(kX, 0),
                         byte(kX, 1),
                         byte(kX, 2),
                         byte(kX, 3),
                         byte(kY, 0),
                         byte(kY, 1),
                         byte(kY, 2),
                         byte(kY, 3),
                         byte(kZ, 0),
                         byte(kZ, 1),
                         byte(kZ, 2),
                         byte(kZ, 3)})};
    }
    default:
      return {report_of({1, at(report, 0)})};
  }
}

Liberty::Liberty()
    : usb_({0x0f44, 0xff12, "LIBERTY", "L1"},
           [this](std::span<const std::byte> bytes) {
             if (bytes.front() == std::byte{'P'}) streams_ = false;
             if (bytes.front() != std::byte{'C'}) return;
             ++starts_;
             streams_ = true;
           }),
      thread_([this] { run(); }) {}

Liberty::~Liberty() {
  stop_ = true;
  static_cast<void>(unplug());  // ends a frame that nobody takes
  thread_.join();
}

Status Liberty::unplug() {
  streams_ = false;
  return usb_.unplug();
}

void Liberty::run() {
  using tracking::PolhemusFrame;
  const auto start = std::chrono::steady_clock::now();
  auto next = start;
  for (std::uint32_t count = 0; !stop_; ++count) {
    next += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / PolhemusFrame::kFrames_hz));
    std::this_thread::sleep_until(next);
    if (!streams_) continue;
    PolhemusFrame frame;
    frame.count = count;
    frame.milliseconds = static_cast<std::uint32_t>(1000 * count / PolhemusFrame::kFrames_hz);
    frame.position_cm = {kX_cm, kY_cm, kZ_cm};
    static_cast<void>(usb_.send(encode(frame, tracking::PolhemusModel::kLiberty)));
  }
}

}  // namespace veneer::lab
