// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/mock_liberty.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <string_view>
#include <utility>

namespace veneer::tracking::mock {
namespace {

constexpr double kSway_cm = 20;
constexpr double kSway_rad_s = 1;
constexpr double kDistance_cm = 150;

PolhemusFrame frame_of(std::uint32_t count) {
  PolhemusFrame frame;
  frame.count = count;
  const double time_s = count / PolhemusFrame::kFrames_hz;
  frame.milliseconds = static_cast<std::uint32_t>(1000 * time_s);
  frame.position_cm = {static_cast<float>(kSway_cm * std::sin(kSway_rad_s * time_s)),
                       0,
                       static_cast<float>(kDistance_cm)};
  return frame;
}

Bytes bytes_of(std::uint32_t count) {
  const auto encoded = encode(frame_of(count), PolhemusModel::kLiberty);
  return {encoded.begin(), encoded.end()};
}

}  // namespace

Liberty::Liberty(std::string serial, std::string usb_port)
    : usb_({kVendor, kProduct, "LIBERTY", std::move(serial), std::move(usb_port), {{kOut}, {kIn}}},
           [this](std::uint8_t, const Bytes& bytes) { return on_write(bytes); }),
      thread_([this] { run(); }) {}

Liberty::~Liberty() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  ends_.notify_all();
  thread_.join();
}

void Liberty::plug() {
  {
    const std::lock_guard lock(mutex_);
    count_ = 0;
    sent_ = 0;
  }
  streams_ = false;
  usb_.plug();
}

void Liberty::unplug() {
  streams_ = false;
  usb_.unplug();
}

Bytes Liberty::newest_frame() const {
  const std::lock_guard lock(mutex_);
  return bytes_of(sent_);
}

int Liberty::on_write(const Bytes& bytes) {
  if (ignores_writes_) return UsbDevice::kNeverDone;
  if (!bytes.empty() && bytes[0] == std::byte{'C'}) {
    streams_ = true;
    ++starts_;
  }
  if (!bytes.empty() && bytes[0] == std::byte{'P'}) streams_ = false;
  return 0;
}

void Liberty::run() {
  std::unique_lock lock(mutex_);
  auto next = std::chrono::steady_clock::now();
  while (!ends_.wait_until(lock, next, [this] { return ended_; })) {
    next += std::chrono::nanoseconds(std::llround(1e9 / PolhemusFrame::kFrames_hz));
    ++count_;
    if (!streams_) continue;
    sent_ = count_;
    const Bytes frame = bytes_of(sent_);
    lock.unlock();  // the bus may be asking us something
    usb_.send(kIn, frame);
    ++frames_;
    lock.lock();
  }
}

void inject_random_fault(Pcg32& random, Liberty& liberty) {
  UsbDevice& usb = liberty.usb();
  const auto any_byte = [&] { return static_cast<std::byte>(random.uniform() * 256); };
  const double kind = random.uniform();
  if (kind < 0.30) {  // garbage
    Bytes bytes(static_cast<std::size_t>(1 + random.uniform() * 100));
    std::ranges::generate(bytes, any_byte);
    usb.send(Liberty::kIn, std::move(bytes));
  } else if (kind < 0.55) {  // a frame cut short
    Bytes bytes = liberty.newest_frame();
    bytes.resize(static_cast<std::size_t>(random.uniform() * static_cast<double>(bytes.size())));
    usb.send(Liberty::kIn, std::move(bytes));
  } else if (kind < 0.75) {  // a duplicate
    usb.send(Liberty::kIn, liberty.newest_frame());
  } else if (kind < 0.95) {  // a frame with some byte changed: its clock, its numbers, its header
    Bytes bytes = liberty.newest_frame();
    bytes[static_cast<std::size_t>(random.uniform() * static_cast<double>(bytes.size()))] =
        any_byte();
    usb.send(Liberty::kIn, std::move(bytes));
  } else if (kind < 0.97) {  // babble
    usb.send(Liberty::kIn, Bytes(600, any_byte()));
  } else if (kind < 0.98) {
    usb.fail_transfer(Liberty::kIn, EPIPE);
  } else if (kind < 0.985) {
    usb.fail_transfer(Liberty::kIn, EPROTO);
  } else if (kind < 0.99) {  // it falls silent
    liberty.forget();
  } else if (kind < 0.995) {  // it starts again, and so does its clock
    liberty.unplug();
    liberty.plug();
  } else if (kind < 0.997) {
    usb.refuse_submits(1 + static_cast<int>(random.uniform() * 8), ENOMEM);
  } else {  // it does not take what it is told, for a while
    liberty.ignore_writes(true);
    liberty.forget();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    liberty.ignore_writes(false);
  }
}

}  // namespace veneer::tracking::mock
