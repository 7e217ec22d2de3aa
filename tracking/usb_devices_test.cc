// SPDX-License-Identifier: Apache-2.0
#include "tracking/usb_devices.h"

#include <gtest/gtest.h>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer::tracking {
namespace {

class UsbDevicesTest : public testing::Test {
 protected:
  void plug(const std::string& port, const std::string& vendor, const std::string& product) const {
    const auto folder = folder_.path() / port;
    std::filesystem::create_directories(folder);
    ASSERT_TRUE(write_text(folder / "idVendor", vendor + "\n"));
    ASSERT_TRUE(write_text(folder / "idProduct", product + "\n"));
  }
  TemporaryFolder folder_;
};

TEST_F(UsbDevicesTest, TrackersAreFoundAmongTheOthersAndSortedByPort) {
  plug("usb1", "1d6b", "0002");  // a hub
  plug("1-2", "1532", "0300");
  plug("1-1.4", "0f44", "ff20");
  ASSERT_TRUE(write_text(folder_.path() / "1-1.4" / "serial", "4711\n"));
  std::filesystem::create_directories(folder_.path() / "1-2:1.0");  // an interface: no ids
  const auto devices = usb_devices(folder_.path());
  ASSERT_EQ(devices.size(), 2U);
  EXPECT_EQ(devices[0].driver, "polhemus");
  EXPECT_EQ(devices[0].serial, "4711");
  EXPECT_EQ(devices[0].port, "1-1.4");
  EXPECT_FALSE(devices[0].needs_firmware);
  EXPECT_EQ(devices[1].driver, "razer-hydra");
  EXPECT_TRUE(devices[1].serial.empty());
}

TEST_F(UsbDevicesTest, ABootLoaderIsToldFromTheDevice) {
  plug("1-1", "0f44", "ff21");
  const auto devices = usb_devices(folder_.path());
  ASSERT_EQ(devices.size(), 1U);
  EXPECT_TRUE(devices[0].needs_firmware);
}

TEST_F(UsbDevicesTest, NonsenseAndNothingAreNoDevices) {
  plug("1-1", "", "zzzz");
  plug("1-2", "0f44ff", "ff20");
  EXPECT_TRUE(usb_devices(folder_.path()).empty());
  EXPECT_TRUE(usb_devices(folder_.path() / "absent").empty());
}

}  // namespace
}  // namespace veneer::tracking
