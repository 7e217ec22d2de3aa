// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <umockdev.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace veneer::tracking::mock {

using Bytes = std::vector<std::byte>;

/// What umockdev puts in the place of /sys, /dev and udev for this process and its children. The
/// program must have been started by umockdev-wrapper. There can be one in a process only; devices
/// go before it.
class Bus {
 public:
  /// Made at the first call, and never destroyed: threads of umockdev's own use it until the end.
  [[nodiscard]] static Bus& instance();
  /// Whether the program was started by umockdev-wrapper; nothing here works otherwise.
  [[nodiscard]] bool is_mocked() const;

  [[nodiscard]] UMockdevTestbed* testbed() const { return testbed_; }
  /// The folder that holds the mocked /sys and /dev.
  [[nodiscard]] std::string root() const;
  void add(const std::string& description);
  void attach(const std::string& node, UMockdevIoctlBase* handler);
  void detach(const std::string& node);
  void announce(const std::string& syspath, const char* action);
  void remove(const std::string& syspath);

 private:
  Bus();
  UMockdevTestbed* testbed_;
};

}  // namespace veneer::tracking::mock
