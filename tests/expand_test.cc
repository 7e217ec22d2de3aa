// SPDX-License-Identifier: Apache-2.0
// `veneer expand` as a person runs it (docs/howto/expand.md).
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <vector>

#include "base/files.h"
#include "base/image_files.h"
#include "base/random.h"
#include "base/safetensors.h"
#include "base/testing/temporary_folder.h"
#include "btf/material.h"
#include "btf/sample_set.h"
#include "btf/texel_map.h"
#include "tests/facing_projector.h"
#include "tests/program.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kSide = 6;  // of the sample, texels

/// A material of texels of one colour each, the same from everywhere: what is drawn of it says
/// which texel it is.
class ExpandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    btf::SampleSetInfo info;
    info.width = info.height = kSide;
    info.views = {btf::Direction::UnitZ()};
    for (int i = 0; i < 4; ++i) info.views.push_back(btf::direction_from_angles({0.9, 1.57 * i}));
    info.lights = info.views;
    auto writer = btf::SampleSetWriter::create(set_, info);
    ASSERT_TRUE(writer);
    Pcg32 random(5);
    for (int texel = 0; texel < info.texel_count(); ++texel) {
      const std::array colour{
          0.1 + 0.5 * random.uniform(), 0.1 + 0.5 * random.uniform(), 0.1 + 0.5 * random.uniform()};
      const auto samples = writer->texel(texel);
      for (std::size_t i = 0; i < samples.size(); ++i)
        samples[i] = Eigen::half(static_cast<float>(colour[i % 3]));
    }
    ASSERT_TRUE(writer->finish());
    const Outcome fitted = run(
        fmt::format("veneer fit {} --model lpca --clusters 1 --components 3 --angular 4 --quiet "
                    "-o {}",
                    set_.string(),
                    sample_.string()));
    ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
    ASSERT_TRUE(facing_projector(240, 180).save(profile_));
  }

  /// Expands `material` to `out`.
  [[nodiscard]] Outcome expanded(const fs::path& material,
                                 const fs::path& out,
                                 const std::string& more = "--size 20x15") const {
    return run(fmt::format("veneer expand {} -o {} --patch 4 --overlap 2 --quiet {}",
                           material.string(),
                           out.string(),
                           more));
  }

  /// What is in the folder, with bytes and dates of writing.
  [[nodiscard]] std::set<std::string> everything() const {
    std::set<std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
      found.insert(fmt::format("{} {} {}",
                               entry.path().string(),
                               entry.is_regular_file() ? entry.file_size() : 0,
                               fs::last_write_time(entry.path()).time_since_epoch().count()));
    return found;
  }

  TemporaryFolder folder_;
  fs::path set_ = folder_.path() / "colours.btfset";
  fs::path sample_ = folder_.path() / "sample.safetensors";
  fs::path profile_ = folder_.path() / "profile";
};

/// The colours of a frame's target where it is covered.
std::vector<Rgb32f> colours(const fs::path& picture) {
  const auto channels = read_exr(picture);
  EXPECT_TRUE(channels) << channels.error().what;
  std::vector<Rgb32f> found;
  if (!channels) return found;
  const auto channel = [&](std::string_view name) {
    return std::ranges::find(*channels, name, &ExrChannel::name)->pixels.pixels();
  };
  for (std::size_t i = 0; i < channel("Y").size(); ++i)
    if (channel("Y")[i] > 0.0F)
      found.emplace_back(channel("X")[i], channel("Y")[i], channel("Z")[i]);
  return found;
}

float distance_to(const std::vector<Rgb32f>& set, const Rgb32f& colour) {
  float least = std::numeric_limits<float>::infinity();
  for (const Rgb32f& one : set) least = std::min(least, (one - colour).cwiseAbs().maxCoeff());
  return least;
}

TEST_F(ExpandTest, WritesAMaterialAsLargeAsAskedForOfTheSamplesTexels) {
  const fs::path large = folder_.path() / "large.safetensors";
  const Outcome done = expanded(sample_, large, "--size 20x15 --json");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const json report = json::parse(done.out);
  EXPECT_EQ(report["width"], 20);
  EXPECT_EQ(report["height"], 15);

  const auto sample = btf::load_material(sample_);
  const auto material = btf::load_material(large);
  ASSERT_TRUE(sample && material) << material.error().what;
  EXPECT_EQ((*material)->model(), (*sample)->model());
  ASSERT_EQ((*material)->width(), 20);
  ASSERT_EQ((*material)->height(), 15);
  ASSERT_NE((*material)->texel_map(), nullptr);
  const auto seen = [](const btf::Material& of, int texel) {
    return of.radiance(texel, btf::Direction(0.3, 0.1, 1).normalized(), btf::Direction::UnitZ());
  };
  std::set<int> shown;
  for (int place = 0; place < 20 * 15; ++place) {
    int same = -1;
    for (int texel = 0; texel < kSide * kSide; ++texel)
      if (seen(**material, place) == seen(**sample, texel)) same = texel;
    ASSERT_GE(same, 0) << place;
    EXPECT_EQ(same, (*material)->texel_map()->source_texel(place));
    shown.insert(same);
  }
  EXPECT_DOUBLE_EQ(report["texels_used"], double(shown.size()) / (kSide * kSide));

  const auto file = SafetensorsFile::open(large);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->meta("expanded_from").value_or(""), sample_.string());
  EXPECT_EQ(file->meta("fitted_on").value_or("none"),
            SafetensorsFile::open(sample_)->meta("fitted_on").value_or(""));
}

TEST_F(ExpandTest, DrawsNoColourThatTheSampleDoesNotDraw) {
  const fs::path large = folder_.path() / "large.safetensors";
  ASSERT_EQ(expanded(sample_, large).exit_code, 0);
  const auto drawn = [&](const fs::path& material, const std::string& repeats) {
    const fs::path scene = folder_.path() / "scene.toml";
    EXPECT_TRUE(
        write_text(scene,
                   fmt::format("mesh = \"plate\"\ntexture_repeats = [{}]\n"
                               "[[light]]\ndirection = [0.3, 0.2, 1]\nilluminance_lux = 300\n",
                               repeats)));
    const fs::path picture = folder_.path() / "target.exr";
    return std::pair(run(fmt::format("veneer render {} --material {} --profile {} -o {} --quiet",
                                     scene.string(),
                                     material.string(),
                                     profile_.string(),
                                     picture.string())),
                     picture);
  };
  const auto [outcome, picture] = drawn(sample_, "1, 1");
  if (outcome.exit_code == 1 && outcome.err.find("EGL") != std::string::npos)
    GTEST_SKIP() << "no GL here: " << outcome.err;
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::vector<Rgb32f> known = colours(picture);
  ASSERT_GT(known.size(), 1000U);
  const auto again = drawn(large, "1, 1");
  ASSERT_EQ(again.first.exit_code, 0) << again.first.err;
  const std::vector<Rgb32f> shown = colours(again.second);
  EXPECT_EQ(shown.size(), known.size());

  // Half floats of up to 64 cd/m^2, of which a model is good to one step or two.
  constexpr float kHalfStep = 64.0F / 1024.0F;
  // It is narrow enough to tell texels from what lies between two of them.
  int apart = 0;
  for (std::size_t i = 1; i < known.size(); ++i) {
    const Rgb32f between = (known[i] + known[i - 1]) / 2;
    if ((known[i] - known[i - 1]).norm() > 10 * kHalfStep)
      apart += distance_to(known, between) > 2 * kHalfStep ? 1 : 0;
  }
  EXPECT_GT(apart, 20);
  for (const Rgb32f& colour : shown)
    ASSERT_LE(distance_to(known, colour), 2 * kHalfStep) << colour.transpose();
  // Many of them, not one.
  std::vector<Rgb32f> distinct;
  for (const Rgb32f& colour : shown)
    if (distance_to(distinct, colour) > 4 * kHalfStep) distinct.push_back(colour);
  EXPECT_GT(distinct.size(), std::size_t{kSide * kSide / 2});
}

TEST_F(ExpandTest, MakesTheSameTileOfTheSameSeedAndNoOtherWayIn) {
  const fs::path first = folder_.path() / "first.safetensors";
  const fs::path second = folder_.path() / "made" / "second.safetensors";  // a folder that is new
  const fs::path third = folder_.path() / "third.safetensors";
  ASSERT_EQ(expanded(sample_, first, "--size 20x15 --seed 3").exit_code, 0);
  ASSERT_EQ(expanded(sample_, second, "--size 20x15 --seed 3").exit_code, 0);
  ASSERT_EQ(expanded(sample_, third, "--size 20x15 --seed 4").exit_code, 0);
  EXPECT_EQ(read_text(first).value(), read_text(second).value());
  EXPECT_NE(read_text(first).value(), read_text(third).value());

  // Onto itself: what was read stays until the new one is whole. Once more there is no sample left.
  const std::string before = read_text(first).value();
  ASSERT_EQ(expanded(sample_, sample_, "--size 20x15 --seed 3").exit_code, 0);
  EXPECT_EQ(read_text(sample_).value(), before);
  EXPECT_TRUE(fails(expanded(sample_, first), 2, "take the material that was expanded"));
  EXPECT_EQ(read_text(first).value(), before);
  // The set has no such places.
  EXPECT_TRUE(fails(run(fmt::format("veneer evaluate {} {}", set_.string(), sample_.string())),
                    1,
                    "by a texel map"));
}

TEST_F(ExpandTest, RefusesWhatItCannotExpandAndLeavesEverythingAsItWas) {
  const fs::path out = folder_.path() / "out.safetensors";
  const fs::path cut = folder_.path() / "cut.safetensors";
  const fs::path noise = folder_.path() / "noise.safetensors";
  const fs::path empty = folder_.path() / "empty.safetensors";
  const std::string whole = read_text(sample_).value();
  ASSERT_TRUE(write_text(cut, whole.substr(0, whole.size() / 2)));
  std::string wrong = whole;
  std::fill(wrong.begin(), wrong.begin() + 64, '\x7f');
  ASSERT_TRUE(write_text(noise, wrong));
  ASSERT_TRUE(write_text(empty, ""));
  const std::set<std::string> before = everything();

  EXPECT_TRUE(fails(expanded(folder_.path() / "none.safetensors", out),
                    1,
                    "none.safetensors: No such file or directory"));
  EXPECT_TRUE(fails(expanded(cut, out), 1, "the file was cut short; write or copy it again"));
  EXPECT_TRUE(fails(expanded(noise, out), 1, noise.string()));
  EXPECT_TRUE(fails(expanded(empty, out), 1, "0 bytes are too few"));
  EXPECT_TRUE(fails(expanded(folder_.path(), out), 1, "it is no regular file"));
  for (const auto& [size, message] :
       {std::pair("5x20", "the width is 5 texels; it must be 6, which the sample has, to 16384"),
        std::pair("20x5", "the height is 5 texels"),
        std::pair("0x0", "expected WIDTHxHEIGHT, 1 to 16384 each"),
        std::pair("16385x20", "expected WIDTHxHEIGHT, 1 to 16384 each"),
        std::pair("99999999999x20", "expected WIDTHxHEIGHT, 1 to 16384 each"),
        std::pair("20.5x20", "expected WIDTHxHEIGHT, 1 to 16384 each")})
    EXPECT_TRUE(fails(expanded(sample_, out, fmt::format("--size={}", size)), 2, message)) << size;
  const auto with = [&](const char* patches) {
    return run(fmt::format(
        "veneer expand {} -o {} --size 20x15 {}", sample_.string(), out.string(), patches));
  };
  EXPECT_TRUE(fails(with("--patch 7 --overlap 2"), 2, "it must have 2 to 6"));
  EXPECT_TRUE(fails(with("--patch 4 --overlap 3"), 2, "it must be 1 to 2, half a patch"));
  EXPECT_TRUE(fails(with("--patch 4 --overlap 0"), 2, "it must be 1 to 2, half a patch"));
  // Where nothing can be written: in a file, and where a folder is.
  EXPECT_TRUE(fails(expanded(sample_, sample_ / "out.safetensors"), 1, "Not a directory"));
  EXPECT_TRUE(fails(expanded(sample_, set_), 1, "Is a directory"));
  EXPECT_EQ(run(fmt::format("veneer expand {}", sample_.string())).exit_code, 2);

  EXPECT_EQ(everything(), before);
}

TEST_F(ExpandTest, IsTimedByTheBenchBesideItsSample) {
  const fs::path large = folder_.path() / "large.safetensors";
  ASSERT_EQ(expanded(sample_, large).exit_code, 0);
  const Outcome timed = run(
      fmt::format("veneer bench render --material {} --material {} --size 64x48 --frames 3 --json "
                  "--quiet",
                  sample_.string(),
                  large.string()));
  if (timed.exit_code == 1 && timed.err.find("EGL") != std::string::npos)
    GTEST_SKIP() << "no GL here: " << timed.err;
  ASSERT_EQ(timed.exit_code, 0) << timed.err;
  const json report = json::parse(timed.out);
  json found;
  for (const json& result : report["results"]) found[result["name"].get<std::string>()] = result;
  ASSERT_TRUE(found.contains("sample") && found.contains("large")) << timed.out;
  EXPECT_GT(found["large"]["ms_median"], 0.0);
  // The map's own costs: one fetch, and four bytes a place.
  EXPECT_EQ(found["large"]["fetches"], found["sample"]["fetches"].get<int>() + 1);
  EXPECT_EQ(found["large"]["gpu_bytes"], found["sample"]["gpu_bytes"].get<int>() + 4 * 20 * 15);
}

}  // namespace
}  // namespace veneer
