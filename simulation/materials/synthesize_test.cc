// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/synthesize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"
#include "simulation/materials/internal_test_fields.h"

namespace veneer::simulation {
namespace {

namespace fs = std::filesystem;

class SynthesizeTest : public testing::Test {
 protected:
  [[nodiscard]] bool left_behind() const { return !fs::is_empty(folder_); }

  TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

SynthesisOptions quick_options() {
  SynthesisOptions options;
  options.size = 4;
  options.views = {toward(0, 0), toward(45, 30), toward(89, 200)};
  options.lights = {toward(0, 0), toward(75, 100), toward(89, 300)};
  options.samples = 2;
  return options;
}

HeightField make_white(int size, std::uint64_t) { return flat_field(size, white_lambert()); }
HeightField make_broken(int size, std::uint64_t) {
  HeightField field = flat_field(size, white_lambert());
  field.heights[0] = std::numeric_limits<float>::quiet_NaN();
  return field;
}
const HeightFieldMaterial kWhite{"white", "flat white Lambert", &make_white};
const HeightFieldMaterial kBroken{"broken", "a NaN for a height", &make_broken};
BodyField make_thin_air(int, std::uint64_t) { return {}; }
const BodyMaterial kThinAir{"thin-air", "nothing at all", &make_thin_air, {}};

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

class CountingProgress final : public Progress {
 public:
  void start(std::string_view, std::int64_t total) override { expected += total; }
  void advance(std::int64_t steps) override { done += steps; }
  void finish(std::string_view) override {}
  std::int64_t expected = 0;
  std::atomic<std::int64_t> done = 0;
};

TEST_F(SynthesizeTest, WritesAPolarisedSetInTheUnitOfASample) {
  const SynthesisOptions options = quick_options();
  CountingProgress progress;
  const Status status = synthesize(kWhite, folder_ / "white.btfset", options, progress);
  ASSERT_TRUE(status.has_value()) << status.error().what;
  EXPECT_EQ(progress.done, progress.expected);
  const auto set = btf::SampleSet::open(folder_ / "white.btfset");
  ASSERT_TRUE(set.has_value()) << set.error().what;
  EXPECT_EQ(set->info().width, 4);
  EXPECT_EQ(set->info().height, 4);
  EXPECT_TRUE(set->info().polarised);
  EXPECT_DOUBLE_EQ(set->info().texel_pitch_mm, 10.0 / 4);
  EXPECT_THAT(set->info().source, testing::HasSubstr("white"));
  std::vector<float> rgb(9 * 3);
  set->rgb(7, btf::Part::kTotal, rgb);
  for (std::size_t pair = 0; pair < 9; ++pair) {
    const double cosine = options.lights[pair % 3].z();
    EXPECT_NEAR(rgb[pair * 3 + 1], cosine, 5e-4 * cosine) << pair;  // half a step of a half: 2^-11
  }
}

TEST_F(SynthesizeTest, EveryMaterialIsFiniteAndNotBlack) {
  SilentProgress silent;
  const auto check = [&](const auto& material) {
    const fs::path out = folder_ / material.name;
    const Status status = synthesize(material, out, quick_options(), silent);
    ASSERT_TRUE(status.has_value()) << material.name << ": " << status.error().what;
    const auto set = btf::SampleSet::open(out);
    ASSERT_TRUE(set.has_value()) << material.name;
    EXPECT_THAT(set->info().source, testing::HasSubstr(std::string(material.name)));
    const Status finite = set->check_finite();
    EXPECT_TRUE(finite.has_value()) << material.name << ": " << finite.error().what;
    EXPECT_GT(static_cast<float>(set->stored(0)[3]) + static_cast<float>(set->stored(0)[0]), 0.0F)
        << material.name;
  };
  std::ranges::for_each(height_field_materials(), check);
  std::ranges::for_each(body_materials(), check);
}

// Run by the test below in processes of their own, since the number of threads is read once.
TEST(SynthesizeInAnotherProcess, DISABLED_WritesWhereItIsTold) {
  const char* const out = std::getenv("VENEER_TEST_OUT");
  ASSERT_NE(out, nullptr);
  SilentProgress silent;
  SynthesisOptions options = quick_options();
  options.size = 8;
  const auto cloth = find_height_field_material("cloth");
  ASSERT_TRUE(cloth.has_value());
  const Status status = synthesize(**cloth, out, options, silent);
  ASSERT_TRUE(status.has_value()) << status.error().what;
}

TEST_F(SynthesizeTest, IsTheSameOnAnyNumberOfThreads) {
  const std::string program = fs::read_symlink("/proc/self/exe").string();
  std::vector<std::string> results;
  for (const std::string threads : {"1", "2", "5"}) {
    const fs::path out = folder_ / threads;
    const std::string command =
        "VENEER_THREADS=" + threads + " VENEER_TEST_OUT='" + out.string() + "' '" + program +
        "' --gtest_also_run_disabled_tests --gtest_filter=SynthesizeInAnotherProcess.* > '" +
        (folder_ / "log").string() + "'";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
    results.push_back(bytes_of(out / "samples.safetensors"));
  }
  ASSERT_FALSE(results[0].empty());
  EXPECT_TRUE(results[0] == results[1]);
  EXPECT_TRUE(results[0] == results[2]);
}

TEST_F(SynthesizeTest, DependsOnTheSeed) {
  SilentProgress silent;
  const auto leather = find_height_field_material("leather");
  ASSERT_TRUE(leather.has_value());
  SynthesisOptions options = quick_options();
  ASSERT_TRUE(synthesize(**leather, folder_ / "one", options, silent).has_value());
  options.seed = 2;
  ASSERT_TRUE(synthesize(**leather, folder_ / "two", options, silent).has_value());
  EXPECT_FALSE(bytes_of(folder_ / "one/samples.safetensors") ==
               bytes_of(folder_ / "two/samples.safetensors"));
}

TEST_F(SynthesizeTest, RefusesBadOptionsAndLeavesNothingBehind) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    std::string field;
    SynthesisOptions options;
  };
  std::vector<Case> cases;
  const auto add = [&](std::string field, const auto& spoil) {
    cases.push_back({std::move(field), quick_options()});
    spoil(cases.back().options);
  };
  add("size", [](SynthesisOptions& o) { o.size = 0; });
  add("size", [](SynthesisOptions& o) { o.size = 513; });
  add("samples", [](SynthesisOptions& o) { o.samples = 0; });
  add("bounces", [](SynthesisOptions& o) { o.bounces = -1; });
  add("views", [](SynthesisOptions& o) { o.views.clear(); });
  add("views", [&](SynthesisOptions& o) { o.views[1] = {kNan, 0.0, 1.0}; });
  add("views", [](SynthesisOptions& o) { o.views[1] = {0.0, 0.0, 2.0}; });
  add("views", [](SynthesisOptions& o) { o.views[1] = toward(90, 0); });
  add("lights", [](SynthesisOptions& o) { o.lights.clear(); });
  add("lights", [](SynthesisOptions& o) { o.lights[0] = toward(120, 0); });
  SilentProgress silent;
  for (const auto& [field, options] : cases) {
    const Status status = synthesize(kWhite, folder_ / "bad.btfset", options, silent);
    ASSERT_FALSE(status.has_value()) << field;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption) << field;
    EXPECT_THAT(status.error().what, testing::HasSubstr(field));
    EXPECT_FALSE(left_behind()) << field;
  }
}

TEST_F(SynthesizeTest, RefusesEqualDirectionsAndBrokenMaterialsAndLeavesNothingBehind) {
  SilentProgress silent;
  SynthesisOptions twice = quick_options();
  twice.lights[1] = twice.lights[0];
  EXPECT_FALSE(synthesize(kWhite, folder_ / "bad.btfset", twice, silent).has_value());
  EXPECT_FALSE(left_behind());
  EXPECT_FALSE(synthesize(kBroken, folder_ / "bad.btfset", quick_options(), silent).has_value());
  EXPECT_FALSE(left_behind());
  EXPECT_FALSE(synthesize(kThinAir, folder_ / "bad.btfset", quick_options(), silent).has_value());
  EXPECT_FALSE(left_behind());
}

TEST_F(SynthesizeTest, SaysSoWhereItCannotWrite) {
  std::ofstream(folder_ / "file") << "in the way";
  SilentProgress silent;
  const Status status =
      synthesize(kWhite, folder_ / "file" / "white.btfset", quick_options(), silent);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(bytes_of(folder_ / "file"), "in the way");
}

}  // namespace
}  // namespace veneer::simulation
