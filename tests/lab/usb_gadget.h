// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"
#include "base/unique_handle.h"

// USB devices that this machine plays itself: the kernel's gadgets (configfs) behind its dummy host
// controller. They need root and the modules dummy_hcd, usb_f_hid, usb_f_fs and usb_f_ss_lb: the
// kernel lab has them.
namespace veneer::lab {

struct GadgetIdentity {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string name;
  std::string serial;
};

/// A device without functions yet. One thread.
class UsbGadget {
 public:
  UsbGadget() = default;
  ~UsbGadget();
  UsbGadget(const UsbGadget&) = delete;
  UsbGadget& operator=(const UsbGadget&) = delete;

  /// Makes it, not plugged in. Errors: kIo, here and below.
  [[nodiscard]] Status create(const GadgetIdentity& identity);
  /// Its next interface. @param function  "hid.0". The folder where its attributes are.
  [[nodiscard]] Result<std::filesystem::path> add_function(const std::string& function);
  /// After its attributes were written.
  [[nodiscard]] Status finish_function(const std::string& function);
  /// Into a free port of the dummy controller.
  [[nodiscard]] Status plug();
  /// As when the cable is pulled.
  [[nodiscard]] Status unplug();
  [[nodiscard]] bool plugged() const { return plugged_; }

 private:
  std::filesystem::path folder_;
  std::vector<std::string> functions_;
  bool plugged_ = false;
};

using HidReport = std::array<std::byte, 64>;

/// A device of one or more HID interfaces, whose reports have 64 bytes, no number, and no meaning
/// that the system knows.
class HidGadget {
 public:
  /// What it says to a report. Called on the gadget's thread.
  using Answer = std::function<std::vector<HidReport>(int interface, const HidReport& report)>;
  struct Layout {
    int hid_interfaces = 1;
    /// An interface of another kind before them, so that theirs begin with 1.
    bool another_first = false;
  };

  HidGadget(GadgetIdentity identity, Layout layout, Answer answer)
      : identity_(std::move(identity)), layout_(layout), answer_(std::move(answer)) {}
  ~HidGadget();
  HidGadget(const HidGadget&) = delete;
  HidGadget& operator=(const HidGadget&) = delete;

  /// Returns when the host has a node for each HID interface.
  [[nodiscard]] Status plug();
  /// Pulls the cable, whatever is said meanwhile.
  [[nodiscard]] Status unplug();

 private:
  [[nodiscard]] Status create();
  void run();
  [[nodiscard]] std::size_t count_nodes() const;
  GadgetIdentity identity_;
  Layout layout_;
  Answer answer_;
  UsbGadget usb_;
  std::vector<std::filesystem::path> folders_;  // of its functions
  std::vector<UniqueFd> ends_;                  // of the device, by HID interface
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A device of one interface, no class, with one bulk endpoint each way that is used (FunctionFS).
class BulkGadget {
 public:
  // The kernel deals out addresses; these are the ones that the dummy controller's endpoints get,
  // since the interface has three others to the host, of which nothing comes, before the one that
  // is used.
  static constexpr std::uint8_t kOut = 0x02;
  static constexpr std::uint8_t kIn = 0x82;
  /// @param received  called on a thread of the gadget with each transfer from the host.
  using Received = std::function<void(std::span<const std::byte> bytes)>;

  BulkGadget(GadgetIdentity identity, Received received)
      : identity_(std::move(identity)), received_(std::move(received)) {}
  ~BulkGadget();
  BulkGadget(const BulkGadget&) = delete;
  BulkGadget& operator=(const BulkGadget&) = delete;

  [[nodiscard]] Status plug();
  [[nodiscard]] Status unplug();
  /// Waits until the host has taken it; false where nothing is plugged in, or no longer.
  [[nodiscard]] bool send(std::span<const std::byte> bytes);

 private:
  [[nodiscard]] Status create();
  void receive();
  GadgetIdentity identity_;
  Received received_;
  UsbGadget usb_;
  std::filesystem::path mount_;
  UniqueFd control_, out_, in_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace veneer::lab
