// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/lab/usb_gadget.h"

// Devices that Veneer drives, played on the kernel's own bus.
namespace veneer::lab {

/// A DLPC350: holds values by command and answers as its layout says. Its second HID interface
/// takes no commands.
class LightEngine {
 public:
  explicit LightEngine(std::string serial = "LCR3", HidGadget::Layout layout = {2, false});
  [[nodiscard]] HidGadget& usb() { return usb_; }
  /// The first byte of what it holds for a command, CMD2 and CMD3.
  [[nodiscard]] int value(int command) const;
  /// Reports that came to the interface that takes none.
  [[nodiscard]] int strays() const { return strays_; }
  /// It hears and says nothing, or does again.
  void be_silent(bool silent) { silent_ = silent; }

 private:
  std::vector<HidReport> answer(int interface, const HidReport& report);
  mutable std::mutex mutex_;
  std::map<int, std::vector<int>> values_;
  std::atomic<int> strays_{0};
  std::atomic<bool> silent_{false};
  HidGadget usb_;
};

/// A ColorHug2 that reads one colour, whatever is before it.
class ColorHug2 {
 public:
  /// 35.5, 40, 16.25 as 16.16 numbers.
  static constexpr std::int32_t kX = 0x238000, kY = 0x280000, kZ = 0x104000;
  ColorHug2();
  [[nodiscard]] HidGadget& usb() { return usb_; }
  /// It says that it is busy, and never more.
  void be_busy(bool busy) { busy_ = busy; }

 private:
  std::vector<HidReport> answer(const HidReport& report) const;
  std::atomic<bool> busy_{false};
  HidGadget usb_;
};

/// A LIBERTY with one station, which stands still: 240 frames a second once it is told to send. One
/// of the older ones, whose endpoints are those of the gadget.
class Liberty {
 public:
  static constexpr float kX_cm = 10, kY_cm = -20, kZ_cm = 150;
  Liberty();
  ~Liberty();
  [[nodiscard]] BulkGadget& usb() { return usb_; }
  /// It was pulled out and forgot what it was told.
  [[nodiscard]] Status unplug();
  /// Times that it was told to send.
  [[nodiscard]] int starts() const { return starts_; }

 private:
  void run();
  std::atomic<bool> stop_{false};
  std::atomic<bool> streams_{false};
  std::atomic<int> starts_{0};
  BulkGadget usb_;
  std::thread thread_;
};

}  // namespace veneer::lab
