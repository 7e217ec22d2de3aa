// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/recorded_devices.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "base/testing/temporary_folder.h"

namespace veneer::calibration {
namespace {

/// Counts what it is asked for; each reading is another number. Fails from reading `fails_at` on.
class CountingDevices final : public PatchDisplay, public Colorimeter {
 public:
  int fails_at = 1 << 20;
  bool not_a_number = false;
  std::vector<Rgb16> shown;
  int readings = 0;

  Status show(const Rgb16& code, bool) override {
    shown.push_back(code);
    return {};
  }
  Status show_picture(ImageView<const Rgb16>) override { return {}; }
  std::string description() const override { return "a counter"; }
  Result<Xyz> read(Target, const Eigen::Vector2d&) override {
    if (readings >= fails_at) return fail(Errc::kDisconnected, "unplugged");
    ++readings;
    if (not_a_number) return Xyz(std::nan(""), 1, 1);
    return Xyz(readings, 0.1 * readings, 1.0 / readings);
  }
};

/// The readings of a small measurement with repeats, or as many as there were before an error.
std::vector<Xyz> measure(RecordedDevices& devices) {
  std::vector<Xyz> result;
  for (const std::uint16_t code : {0, 100, 100, 255}) {
    if (!devices.show({code, code, code})) return result;
    for (int repeat = 0; repeat < 3; ++repeat) {
      const auto xyz = devices.read(Target::kWhiteReference, {320, 240});
      if (!xyz) return result;
      result.push_back(*xyz);
    }
  }
  return result;
}

struct Recorded {
  CountingDevices devices;
  std::optional<Journal> journal;
  std::optional<RecordedDevices> recorded;

  explicit Recorded(const std::filesystem::path& folder) {
    auto opened = Journal::open({"test", "opening", "busy", "restart"}, folder, {{"a", 1}});
    VENEER_CHECK(opened.has_value());
    journal.emplace(std::move(*opened));
    recorded.emplace(devices, devices, *journal);
    recorded->begin("light");
  }
};

TEST(RecordedDevices, AMeasurementThatBreaksAnywhereEndsAsIfItHadNot) {
  const TemporaryFolder folder;
  std::vector<Xyz> whole;
  {
    Recorded run(folder.path() / "whole");
    whole = measure(*run.recorded);
    ASSERT_EQ(whole.size(), 12U);
  }
  for (int cut = 0; cut < 12; ++cut) {
    const auto session = folder.path() / std::to_string(cut);
    std::vector<Xyz> before;
    {
      Recorded run(session);
      run.devices.fails_at = cut;
      before = measure(*run.recorded);
      ASSERT_EQ(static_cast<int>(before.size()), cut);
    }
    Recorded run(session);
    const std::vector<Xyz> after = measure(*run.recorded);
    ASSERT_EQ(after.size(), 12U);
    EXPECT_EQ(run.recorded->recalled(), cut);
    EXPECT_EQ(run.recorded->taken(), 12 - cut);
    EXPECT_EQ(run.devices.readings, 12 - cut);
    for (int i = 0; i < cut; ++i)
      EXPECT_EQ(after[static_cast<std::size_t>(i)], before[static_cast<std::size_t>(i)]);
    // Nothing was shown that was not read.
    EXPECT_EQ(run.devices.shown.size(), static_cast<std::size_t>((12 - cut + 2) / 3));
  }
}

TEST(RecordedDevices, DoesNotKeepWhatIsNoNumber) {
  const TemporaryFolder folder;
  {
    Recorded run(folder.path());
    run.devices.not_a_number = true;
    ASSERT_TRUE(run.recorded->show({1, 1, 1}));
    EXPECT_FALSE(run.recorded->read(Target::kObject, {1, 2})->allFinite());
  }
  Recorded run(folder.path());
  ASSERT_TRUE(run.recorded->show({1, 1, 1}));
  EXPECT_TRUE(run.recorded->read(Target::kObject, {1, 2})->allFinite());
  EXPECT_EQ(run.recorded->taken(), 1);
}

TEST(RecordedDevices, StepsTargetsSpotsAndTheLampAreToldApart) {
  const TemporaryFolder folder;
  Recorded run(folder.path());
  const auto read = [&](Target target, const Eigen::Vector2d& pixel, bool lit) {
    EXPECT_TRUE(run.recorded->show({9, 9, 9}, lit));
    return run.recorded->read(target, pixel)->x();
  };
  std::vector<double> values{read(Target::kObject, {1, 2}, true),
                             read(Target::kWhiteReference, {1, 2}, true),
                             read(Target::kObject, {2, 2}, true),
                             read(Target::kObject, {1, 2}, false)};
  run.recorded->begin("verify");
  values.push_back(read(Target::kObject, {1, 2}, true));
  EXPECT_EQ(values, (std::vector<double>{1, 2, 3, 4, 5}));  // all were really taken
}

}  // namespace
}  // namespace veneer::calibration
