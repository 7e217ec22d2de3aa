// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/shutter_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace veneer::capture {
namespace {

TEST(ShutterSpeed, ReadsWhatMakersWrite) {
  EXPECT_DOUBLE_EQ(*shutter_seconds("1/125"), 1.0 / 125);  // Canon, Nikon
  EXPECT_DOUBLE_EQ(*shutter_seconds("0.0080s"), 0.008);    // PTP's own property
  EXPECT_DOUBLE_EQ(*shutter_seconds("13/10"), 1.3);        // Sony
  EXPECT_DOUBLE_EQ(*shutter_seconds("30"), 30);
  EXPECT_DOUBLE_EQ(*shutter_seconds(" 1.3 s "), 1.3);
}

TEST(ShutterSpeed, RefusesWhatIsNoTime) {
  for (const char* name : {"bulb",
                           "Bulb",
                           "auto",
                           "Time",
                           "",
                           "s",
                           "/",
                           "1/",
                           "/2",
                           "1/0",
                           "0",
                           "-1",
                           "nan",
                           "inf",
                           "1e400",
                           "1/2/3",
                           "0x10"}) {
    EXPECT_FALSE(shutter_seconds(name)) << name;
  }
}

TEST(ShutterSpeed, SortsAndLeavesBulbOut) {
  const std::vector<std::string> names{"bulb", "30", "1/8000", "1/2"};
  const auto speeds = shutter_speeds(names);
  ASSERT_EQ(speeds.size(), 3u);
  EXPECT_EQ(speeds[0].name, "1/8000");
  EXPECT_EQ(speeds[1].name, "1/2");
  EXPECT_EQ(speeds[2].name, "30");
}

TEST(NearestSpeed, IsNearestInRatio) {
  const std::vector<std::string> names{"1/100", "1/25", "1"};
  const auto speeds = shutter_speeds(names);
  // The geometric mean of 0.01 and 0.04 is 0.02; their mean 0.025.
  EXPECT_EQ(nearest_speed(speeds, 0.0199)->name, "1/100");
  EXPECT_EQ(nearest_speed(speeds, 0.0201)->name, "1/25");
  for (const auto& speed : speeds)
    EXPECT_EQ(nearest_speed(speeds, speed.seconds)->name, speed.name);
}

TEST(NearestSpeed, NamesTheRangeThatIsLeft) {
  const std::vector<std::string> names{"1/4000", "30"};
  const auto speeds = shutter_speeds(names);
  for (const double seconds :
       {0.0, -1.0, 1.0 / 5000, 31.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    const auto speed = nearest_speed(speeds, seconds);
    ASSERT_FALSE(speed) << seconds;
    EXPECT_EQ(speed.error().code, Errc::kInvalidOption);
    EXPECT_NE(speed.error().what.find("\"1/4000\" to \"30\""), std::string::npos)
        << speed.error().what;
  }
}

TEST(NearestSpeed, SaysHowToGetSpeedsWhereThereAreNone) {
  const auto speed = nearest_speed({}, 1);
  ASSERT_FALSE(speed);
  EXPECT_EQ(speed.error().code, Errc::kUnavailable);
}

}  // namespace
}  // namespace veneer::capture
