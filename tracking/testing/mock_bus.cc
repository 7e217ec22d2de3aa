// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/mock_bus.h"

#include <chrono>
#include <filesystem>
#include <thread>

#include "base/result.h"

namespace veneer::tracking::mock {

Bus& Bus::instance() {
  static Bus* const bus = new Bus;
  return *bus;
}

Bus::Bus() : testbed_(umockdev_testbed_new()) {}

// umockdev keeps the first answer, so it must not be asked before there is a testbed.
bool Bus::is_mocked() const { return umockdev_in_mock_environment() != 0; }

std::string Bus::root() const {
  char* const folder = umockdev_testbed_get_root_dir(testbed_);
  std::string result = folder;
  g_free(folder);
  return result;
}

void Bus::add(const std::string& description) {
  VENEER_CHECK(umockdev_testbed_add_from_string(testbed_, description.c_str(), nullptr));
}

void Bus::attach(const std::string& node, UMockdevIoctlBase* handler) {
  VENEER_CHECK(umockdev_testbed_attach_ioctl(testbed_, node.c_str(), handler, nullptr));
}

void Bus::detach(const std::string& node) {
  // umockdev ends a program whose connection it has not yet taken when it detaches. So nobody may
  // connect from now on, and who just has is given a moment.
  std::filesystem::remove(root() + "/ioctl" + node);
  std::this_thread::sleep_for(std::chrono::milliseconds(10));
  VENEER_CHECK(umockdev_testbed_detach_ioctl(testbed_, node.c_str(), nullptr));
}

void Bus::announce(const std::string& syspath, const char* action) {
  umockdev_testbed_uevent(testbed_, syspath.c_str(), action);
}

void Bus::remove(const std::string& syspath) {
  umockdev_testbed_remove_device(testbed_, syspath.c_str());
}

}  // namespace veneer::tracking::mock
