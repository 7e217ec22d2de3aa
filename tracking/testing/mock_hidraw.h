// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "tracking/testing/mock_bus.h"

namespace veneer::tracking::mock {

struct HidDescription {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string name;
  std::string serial;  ///< empty: none
  std::string usb_port = "2-1";
  int interface = 0;
};

/// A /dev/hidrawN on the mocked bus, which the real hidapi talks to. Any thread may use it.
class HidrawDevice {
 public:
  /// How a feature report that was sent ends: 0 or an errno. Called on umockdev's thread; set it
  /// before plug().
  using OnFeature = std::function<int(const Bytes& report)>;

  /// Hears every output report, its number in front, as hidapi wrote it; may send() replies. Called
  /// on umockdev's thread.
  using OnOutput = std::function<void(const Bytes& report)>;

  explicit HidrawDevice(HidDescription description, OnFeature on_feature = {});
  ~HidrawDevice();
  HidrawDevice(const HidrawDevice&) = delete;
  HidrawDevice& operator=(const HidrawDevice&) = delete;

  /// Every time under a new number.
  void plug();
  /// As it is pulled out: whoever polls is hung up on, reports that were not read are lost.
  void unplug();
  [[nodiscard]] bool is_plugged() const;
  /// Set it before plug().
  void on_output(OnOutput on_output) { on_output_ = std::move(on_output); }
  /// For the next plug.
  void move_to(std::string usb_port) { description_.usb_port = std::move(usb_port); }
  [[nodiscard]] const std::string& node() const { return node_; }

  /// One input report.
  void send(Bytes report);
  /// One read fails, with an errno.
  void fail_read(int error);

  [[nodiscard]] std::uint64_t reads() const { return reads_; }
  [[nodiscard]] std::uint64_t features() const { return features_; }
  /// Times that it was opened.
  [[nodiscard]] std::uint64_t openings() const { return openings_; }

 private:
  struct Report {
    Bytes bytes;
    int error = 0;
  };
  static gboolean on_read(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);
  static gboolean on_write(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);
  static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);
  static void on_connected(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self);

  void push(Report report);
  void put_tokens(std::size_t count);
  void hang_up();
  [[nodiscard]] std::string description_text() const;
  [[nodiscard]] std::string usb_path() const;

  HidDescription description_;
  OnFeature on_feature_;
  OnOutput on_output_;
  UMockdevIoctlBase* handler_;
  std::string node_;
  std::string hid_path_;  // below /sys; the node's own is below that

  mutable std::mutex mutex_;
  bool plugged_ = false;
  int terminal_ = -1;  // our end of what the node is; umockdev's, not to be closed
  std::deque<Report> reports_;
  std::atomic<std::uint64_t> reads_{0};
  std::atomic<std::uint64_t> features_{0};
  std::atomic<std::uint64_t> openings_{0};
};

}  // namespace veneer::tracking::mock
