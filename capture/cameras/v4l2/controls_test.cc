// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <limits>
#include <map>

#include "capture/cameras/v4l2/internal_controls.h"

namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

/// A webcam's controls by the kernel's rules: the exposure takes no value while it is automatic.
class FakeControls final : public ControlPort {
 public:
  struct Control {
    std::int32_t least, most, step, now;
    bool stuck = false;  // takes a value and keeps its own
  };
  std::map<std::uint32_t, Control> controls;
  bool unplugged = false;

  int query(std::uint32_t id, v4l2_queryctrl& description) override {
    if (unplugged) return ENODEV;
    const auto control = controls.find(id);
    if (control == controls.end()) return EINVAL;
    description.id = id;
    description.minimum = control->second.least;
    description.maximum = control->second.most;
    description.step = control->second.step;
    return 0;
  }
  int read(std::uint32_t id, std::int32_t& value) override {
    if (unplugged) return ENODEV;
    if (!controls.contains(id)) return EINVAL;
    value = controls[id].now;
    return 0;
  }
  int write(std::uint32_t id, std::int32_t value) override {
    if (unplugged) return ENODEV;
    if (!controls.contains(id)) return EINVAL;
    Control& control = controls[id];
    if (value < control.least || value > control.most) return ERANGE;
    if (id == V4L2_CID_EXPOSURE_ABSOLUTE && controls.contains(V4L2_CID_EXPOSURE_AUTO) &&
        controls[V4L2_CID_EXPOSURE_AUTO].now != V4L2_EXPOSURE_MANUAL) {
      return EACCES;
    }
    if (!control.stuck) control.now = value;
    return 0;
  }
};

FakeControls webcam() {
  FakeControls port;
  port.controls[V4L2_CID_EXPOSURE_AUTO] = {0, 3, 1, V4L2_EXPOSURE_APERTURE_PRIORITY};
  port.controls[V4L2_CID_EXPOSURE_AUTO_PRIORITY] = {0, 1, 1, 1};
  port.controls[V4L2_CID_AUTO_WHITE_BALANCE] = {0, 1, 1, 1};
  port.controls[V4L2_CID_AUTOGAIN] = {0, 1, 1, 1};
  port.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = {3, 2047, 4, 155};
  return port;
}

TEST(SwitchAutomaticsOff, LeavesNoneOn) {
  FakeControls port = webcam();
  ASSERT_TRUE(switch_automatics_off(port));
  EXPECT_EQ(port.controls[V4L2_CID_EXPOSURE_AUTO].now, V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(port.controls[V4L2_CID_EXPOSURE_AUTO_PRIORITY].now, 0);
  EXPECT_EQ(port.controls[V4L2_CID_AUTO_WHITE_BALANCE].now, 0);
  EXPECT_EQ(port.controls[V4L2_CID_AUTOGAIN].now, 0);
}

TEST(SwitchAutomaticsOff, NamesTheOneThatStaysOn) {
  const std::map<std::uint32_t, std::string> names{{V4L2_CID_EXPOSURE_AUTO, "exposure"},
                                                   {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "frame rate"},
                                                   {V4L2_CID_AUTO_WHITE_BALANCE, "white balance"},
                                                   {V4L2_CID_AUTOGAIN, "gain"}};
  for (const auto& [id, name] : names) {
    FakeControls port = webcam();
    port.controls[id].stuck = true;
    const auto status = switch_automatics_off(port);
    ASSERT_FALSE(status) << name;
    EXPECT_EQ(status.error().code, Errc::kUnavailable);
    EXPECT_THAT(status.error().what, HasSubstr("automatic " + name));
  }
}

TEST(SwitchAutomaticsOff, TakesACameraWithoutAnyAndNoticesOneThatIsGone) {
  FakeControls port;
  EXPECT_TRUE(switch_automatics_off(port));
  port.unplugged = true;
  const auto status = switch_automatics_off(port);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kDisconnected);
}

TEST(ExposureControl, ComesBackAsTheNearestStepThatWasSet) {
  FakeControls port = webcam();
  ASSERT_TRUE(switch_automatics_off(port));
  const auto control = ExposureControl::find(port);
  ASSERT_TRUE(control && *control);
  for (const double seconds : {0.0003, 0.001, 0.01, 1.0 / 60, 0.1, 0.2}) {
    const auto set = (*control)->set(port, seconds);
    ASSERT_TRUE(set) << set.error().what;
    // Half a step of four units of 100 us; the last step of the range ends below its maximum.
    EXPECT_NEAR(*set, seconds, 0.5 * 4 * 100e-6 + 1e-12) << seconds;
    EXPECT_EQ((port.controls[V4L2_CID_EXPOSURE_ABSOLUTE].now - 3) % 4, 0);
    EXPECT_DOUBLE_EQ(*(*control)->read(port), *set);
  }
}

TEST(ExposureControl, StaysWithinItsRangeAtBothEnds) {
  FakeControls port = webcam();
  const auto control = ExposureControl::find(port);
  ASSERT_TRUE(control && *control);
  EXPECT_DOUBLE_EQ((*control)->range().least_s, 0.0003);
  EXPECT_DOUBLE_EQ((*control)->range().most_s, 0.2047);
  EXPECT_EQ(*(*control)->units(0.0003), 3);
  EXPECT_EQ(*(*control)->units(0.2047), 2047);
  for (const double seconds :
       {0.0, -1.0, 0.0002, 0.2049, std::nan(""), std::numeric_limits<double>::infinity()}) {
    const auto units = (*control)->units(seconds);
    ASSERT_FALSE(units) << seconds;
    EXPECT_EQ(units.error().code, Errc::kInvalidOption);
    EXPECT_THAT(units.error().what, HasSubstr("0.0003 to 0.2047 s"));
  }
}

TEST(ExposureControl, SaysWhenTheCameraTakesNone) {
  FakeControls automatic = webcam();
  const auto control = ExposureControl::find(automatic);
  ASSERT_TRUE(control && *control);
  const auto refused = (*control)->set(automatic, 0.01);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kUnavailable);
  automatic.unplugged = true;
  EXPECT_EQ((*control)->set(automatic, 0.01).error().code, Errc::kDisconnected);
  FakeControls none;
  const auto absent = ExposureControl::find(none);
  ASSERT_TRUE(absent);
  EXPECT_FALSE(*absent);
}

}  // namespace
}  // namespace veneer::capture
