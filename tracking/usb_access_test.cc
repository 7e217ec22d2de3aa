// SPDX-License-Identifier: Apache-2.0
#include "tracking/usb_access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer::tracking {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// For a while not root, to whom nothing is forbidden.
class AsNobody {
 public:
  AsNobody() : self_(::geteuid()) {
    constexpr uid_t kNobody = 65534;
    if (self_ == 0) {
      EXPECT_EQ(::setresuid(kNobody, kNobody, self_), 0);
    }
  }
  ~AsNobody() { EXPECT_EQ(::setresuid(self_, self_, self_), 0); }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;

 private:
  uid_t self_;
};

/// A machine with one tracker that may be used.
class UsbAccess : public ::testing::Test {
 protected:
  void SetUp() override { fs::permissions(folder_.path(), fs::perms::all); }
  void write(const fs::path& path, const std::string& text) const {
    fs::create_directories(path.parent_path());
    ASSERT_TRUE(write_text(path, text));
    fs::permissions(path, fs::perms::all);
  }
  /// Sees it as the command does; its node.
  fs::path plug_liberty(const std::string& product = "ff20") const {
    const fs::path device = folders_.usb / "1-2";
    write(device / "idVendor", "0f44\n");
    write(device / "idProduct", product + "\n");
    write(device / "busnum", "1\n");
    write(device / "devnum", "17\n");
    write(folders_.dev / "bus/usb/001/017", "");
    return folders_.dev / "bus/usb/001/017";
  }
  fs::path plug_hydra() const {
    const fs::path device = folders_.usb / "1-3";
    write(device / "idVendor", "1532\n");
    write(device / "idProduct", "0300\n");
    for (const char* number : {"0", "1"}) {
      const fs::path interface = device / (std::string("1-3:1.") + number);
      fs::create_directories(interface / "0003:1532:0300.0001" / "hidraw" /
                             (std::string("hidraw") + number));
      fs::create_directories(interface / "power");
      write(folders_.dev / (std::string("hidraw") + number), "");
    }
    return folders_.dev / "hidraw1";
  }
  void open_by(const std::string& process, const std::string& name, const fs::path& node) const {
    write(folders_.proc / process / "comm", name + "\n");
    fs::create_directories(folders_.proc / process / "fd");
    fs::create_symlink("/dev/null", folders_.proc / process / "fd" / "0");
    fs::create_symlink(node, folders_.proc / process / "fd" / "7");
  }
  /// What is said of the only tracker; empty where it can be used.
  std::string obstacle() const {
    const auto devices = usb_devices(folders_.usb);
    EXPECT_EQ(devices.size(), 1U);
    const AsNobody nobody;
    const Status status = check_access(devices.at(0), folders_);
    return status ? "" : status.error().what;
  }

  TemporaryFolder folder_;
  SystemFolders folders_{folder_.path() / "usb", folder_.path() / "dev", folder_.path() / "proc"};
};

TEST_F(UsbAccess, WhatMayBeOpenedAndIsFreeCanBeUsed) {
  const fs::path node = plug_liberty();
  EXPECT_EQ(obstacle(), "");
  open_by("300", "bash", "/dev/tty");
  open_by(std::to_string(::getpid()), "self", node);
  write(folders_.proc / "meminfo", "");
  EXPECT_EQ(obstacle(), "") << "other files, our own descriptors and no processes";
}

TEST_F(UsbAccess, WithoutPermissionTheRuleAndTheGroupAreNamed) {
  const fs::path node = plug_liberty();
  fs::permissions(node, fs::perms::owner_all);
  if (::geteuid() != 0) fs::permissions(node, fs::perms::none);
  EXPECT_THAT(obstacle(),
              AllOf(HasSubstr(node.string()),
                    HasSubstr("etc/udev/60-veneer-trackers.rules"),
                    HasSubstr("/etc/udev/rules.d"),
                    HasSubstr("plugdev")));
}

TEST_F(UsbAccess, ToReadIsNotEnough) {
  constexpr fs::perms kRead =
      fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read;
  fs::permissions(plug_liberty(), kRead);
  EXPECT_THAT(obstacle(), HasSubstr("permission denied"));
}

TEST_F(UsbAccess, WhoHoldsItIsNamed) {
  open_by("4711", "vrpn_server", plug_liberty());
  EXPECT_THAT(obstacle(), AllOf(HasSubstr("vrpn_server (process 4711)"), HasSubstr("stop")));
}

TEST_F(UsbAccess, WithoutFirmwareNothingElseIsSaid) {
  const fs::path node = plug_liberty("ff21");
  fs::permissions(node, fs::perms::none);
  EXPECT_THAT(obstacle(), AllOf(HasSubstr("fxload"), Not(HasSubstr("permission"))));
}

TEST_F(UsbAccess, EveryNodeOfAHidDeviceIsLookedAt) {
  const fs::path second = plug_hydra();
  EXPECT_EQ(obstacle(), "");
  open_by("99", "steam", second);
  EXPECT_EQ(obstacle(), "") << "a HID device may be open twice";
  fs::permissions(second, fs::perms::none);
  EXPECT_THAT(obstacle(), AllOf(HasSubstr("hidraw1"), HasSubstr("permission denied")));
}

TEST_F(UsbAccess, WithoutANodeItSaysWhatMayBeMissing) {
  const fs::path node = plug_liberty();
  fs::remove(node);
  EXPECT_THAT(obstacle(), HasSubstr("plug it in again"));
  fs::remove(folders_.usb / "1-2" / "devnum");
  EXPECT_THAT(obstacle(), HasSubstr("udev"));
  write(folders_.usb / "1-2" / "devnum", "many");
  EXPECT_THAT(obstacle(), HasSubstr("udev"));
}

}  // namespace
}  // namespace veneer::tracking
