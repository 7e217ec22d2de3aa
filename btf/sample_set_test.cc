// SPDX-License-Identifier: Apache-2.0
#include "btf/sample_set.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <functional>
#include <limits>

#include "base/files.h"
#include "btf/internal_sample_set.h"
#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

SampleSetInfo small_info(bool polarised = false) {
  SampleSetInfo info;
  info.width = 3;
  info.height = 2;
  info.texel_pitch_mm = 0.25;
  info.polarised = polarised;
  info.views = {Direction::UnitZ(), direction_from_angles({0.5, 1.0})};
  info.lights = {
      Direction::UnitZ(), direction_from_angles({0.7, 2.0}), direction_from_angles({1.5, 4.0})};
  info.source = "a \"quoted\" \\ name\nof two lines";
  info.licence = "CC0";
  return info;
}

// Different for every sample and exact in float16.
float pattern(int texel, int view, int light, int channel) {
  return static_cast<float>(texel) + 0.25F * static_cast<float>(view) +
         0.0625F * static_cast<float>(light) + 0.0078125F * static_cast<float>(channel);
}

TEST(SampleSet, RoundTrip) {
  const TemporaryFolder folder;
  const SampleSet set = testing::make_set(folder.path() / "a.btfset", small_info(), pattern);
  EXPECT_EQ(set.info().width, 3);
  EXPECT_EQ(set.info().height, 2);
  EXPECT_EQ(set.info().texel_pitch_mm, 0.25);
  EXPECT_FALSE(set.info().polarised);
  EXPECT_EQ(set.info().source, small_info().source);
  EXPECT_EQ(set.info().licence, "CC0");
  ASSERT_EQ(set.info().lights.size(), 3U);
  EXPECT_LT((set.info().lights[2] - small_info().lights[2]).norm(), 1e-14);
  std::vector<float> rgb(static_cast<std::size_t>(set.info().pair_count()) * 3);
  for (int texel = 0; texel < 6; ++texel) {
    set.rgb(texel, Part::kTotal, rgb);
    std::size_t i = 0;
    for (int view = 0; view < 2; ++view)
      for (int light = 0; light < 3; ++light)
        for (int channel = 0; channel < 3; ++channel)
          EXPECT_EQ(rgb[i++], pattern(texel, view, light, channel));
  }
  EXPECT_TRUE(set.check_finite());
}

// File names may hold any bytes; what is written must be read again.
TEST(SampleSet, ASourceThatIsNoUtf8IsMended) {
  const std::string mark = "\xef\xbf\xbd";
  const std::vector<std::pair<std::string, std::string>> cases{
      {"\x7f \xc3\xa4 \xe2\x82\xac \xf0\x9f\x8e\xa8",
       "\x7f \xc3\xa4 \xe2\x82\xac \xf0\x9f\x8e\xa8"},
      {"w\xf6lle", "w" + mark + "lle"},  // Latin-1
      {"\xc3", mark},                    // cut short
      {"\xe2\x82", mark + mark},
      {"\xc0\xaf", mark + mark},  // longer than needed
      {"\xe0\x80\xaf", mark + mark + mark},
      {"\xed\xa0\x80", mark + mark + mark},             // a surrogate
      {"\xf4\x90\x80\x80", mark + mark + mark + mark},  // beyond Unicode
      {"\x80\xff", mark + mark}};
  for (const auto& [bytes, expected] : cases) {
    const TemporaryFolder folder;
    SampleSetInfo info = small_info();
    info.source = bytes;
    EXPECT_EQ(testing::make_set(folder.path() / "a.btfset", info, pattern).info().source, expected);
  }
}

TEST(SampleSet, TotalOfAPolarisedSetIsTheSumOfItsParts) {
  const TemporaryFolder folder;
  const SampleSet set = testing::make_set(folder.path() / "a.btfset", small_info(true), pattern);
  ASSERT_EQ(set.info().channel_count(), 6);
  std::vector<float> total(18);
  std::vector<float> specular(18);
  std::vector<float> diffuse(18);
  set.rgb(4, Part::kTotal, total);
  set.rgb(4, Part::kSpecular, specular);
  set.rgb(4, Part::kDiffuse, diffuse);
  for (std::size_t i = 0; i < 18; ++i) EXPECT_EQ(total[i], specular[i] + diffuse[i]);
  EXPECT_EQ(specular[3], pattern(4, 0, 1, 0));
  EXPECT_EQ(diffuse[3], pattern(4, 0, 1, 3));
}

TEST(SampleSet, ChosenPairsAreThoseOfTheWholeAtAnyScale) {
  for (const bool polarised : {false, true}) {
    const TemporaryFolder folder;
    const SampleSet set =
        testing::make_set(folder.path() / "a.btfset", small_info(polarised), pattern)
            .with_scale(0.25);
    std::vector<float> all(3 * static_cast<std::size_t>(set.info().pair_count()));
    std::vector<float> some(6);
    set.rgb(4, Part::kTotal, all);
    set.rgb(4, Part::kTotal, std::array{1, 4}, some);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(some[c], all[3 + c]);
      EXPECT_EQ(some[3 + c], all[12 + c]);
    }
  }
}

TEST(SampleSet, CheckFiniteNamesTheFirstBadSample) {
  const TemporaryFolder folder;
  const SampleSet set =
      testing::make_set(folder.path() / "a.btfset", small_info(), [](int t, int v, int l, int c) {
        if (t == 4 && v == 1 && l == 2 && c == 1) return std::numeric_limits<float>::quiet_NaN();
        if (t == 5 && v == 0) return -std::numeric_limits<float>::infinity();
        return pattern(t, v, l, c);
      });
  const Status status = set.check_finite();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kBadFormat);
  EXPECT_NE(status.error().what.find("10 samples"), std::string::npos) << status.error().what;
  EXPECT_NE(status.error().what.find("texel 4 (row 1, column 1), view 1, light 2"),
            std::string::npos)
      << status.error().what;
}

TEST(SampleSet, LargestFloat16IsFinite) {
  const TemporaryFolder folder;
  const SampleSet set = testing::make_set(
      folder.path() / "a.btfset", small_info(), [](int, int, int, int) { return 65504.0F; });
  EXPECT_TRUE(set.check_finite());
}

TEST(SampleSetWriter, LeavesNothingUnlessFinished) {
  const TemporaryFolder folder;
  {
    auto writer = SampleSetWriter::create(folder.path() / "a.btfset", small_info());
    ASSERT_TRUE(writer) << writer.error().what;
    writer->texel(0)[0] = Eigen::half(1.0F);
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(SampleSetWriter, ReplacesAnOlderSet) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.btfset";
  (void)testing::make_set(path, small_info(true), pattern);
  const SampleSet set = testing::make_set(path, small_info(), pattern);
  EXPECT_FALSE(set.info().polarised);
}

TEST(SampleSetWriter, RefusesWhatCannotBeASet) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::function<void(SampleSetInfo&)>& spoil, const char* says) {
    SampleSetInfo info = small_info();
    spoil(info);
    const auto writer = SampleSetWriter::create(folder.path() / "a.btfset", info);
    ASSERT_FALSE(writer) << says;
    EXPECT_EQ(writer.error().code, Errc::kInvalidOption);
    EXPECT_NE(writer.error().what.find(says), std::string::npos) << writer.error().what;
  };
  refused([](SampleSetInfo& i) { i.width = 0; }, "0 x 2 texels");
  refused([](SampleSetInfo& i) { i.width = i.height = 1 << 20; }, "texels");
  refused([](SampleSetInfo& i) { i.views.clear(); }, "no views");
  const auto on_an_arc = [](std::size_t count) {
    DirectionSet directions;
    for (std::size_t i = 0; i < count; ++i)
      directions.push_back(direction_from_angles({1.5 * double(i) / double(count), 0}));
    return directions;
  };
  refused([&](SampleSetInfo& i) { i.views = on_an_arc(internal::kMostDirections + 1); },
          "5001 views, over 5000");
  SampleSetInfo most = small_info();
  most.views = on_an_arc(internal::kMostDirections);
  EXPECT_TRUE(internal::check_info(most, Errc::kBadFormat, "trying"));
  refused([](SampleSetInfo& i) { i.lights.push_back(i.lights[1]); },
          "directions 1 and 3 are equal");
  refused([](SampleSetInfo& i) { i.lights[0] *= 2.0; }, "no unit vector");
  refused([](SampleSetInfo& i) { i.lights[0] = -Direction::UnitZ(); }, "upper hemisphere");
  refused([](SampleSetInfo& i) { i.views[1].x() = std::numeric_limits<double>::quiet_NaN(); },
          "no unit vector");
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

// One way to damage a good set, and what the error must say.
struct Damage {
  const char* name;
  std::function<void(const fs::path&)> apply;
  Errc code;
  const char* says;
};

void replace_in(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = *read_text(file);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  ASSERT_TRUE(write_text(file, text));
}

class DamagedSet : public ::testing::TestWithParam<Damage> {};

TEST_P(DamagedSet, IsRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.btfset";
  (void)testing::make_set(path, small_info(), pattern);
  GetParam().apply(path);
  const auto set = SampleSet::open(path);
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().code, GetParam().code) << set.error().what;
  EXPECT_NE(set.error().what.find(GetParam().says), std::string::npos) << set.error().what;
}

Damage edit(const char* name, const char* from, const char* to, const char* says) {
  return {name,
          [=](const fs::path& set) { replace_in(set / "set.toml", from, to); },
          Errc::kBadFormat,
          says};
}
Damage drop(const char* name, const char* file) {
  return {name, [=](const fs::path& set) { fs::remove(set / file); }, Errc::kNotFound, file};
}

INSTANTIATE_TEST_SUITE_P(
    All,
    DamagedSet,
    ::testing::Values(
        Damage{"no_folder",
               [](const fs::path& set) { fs::remove_all(set); },
               Errc::kNotFound,
               "no such folder"},
        drop("no_toml", "set.toml"),
        drop("no_views", "views.csv"),
        drop("no_lights", "lights.csv"),
        drop("no_samples", "samples.safetensors"),
        edit("unknown_key", "licence", "license", "license"),
        edit("missing_key", "cosine = \"included\"\n", "", "cosine"),
        edit("no_toml_at_all", "layout", "]]", "set.toml"),
        edit("other_layout", "product", "pairs", "product"),
        edit("other_cosine", "included", "excluded", "included"),
        edit("no_scale", "scale = 1.0", "scale = 0.0", "scale"),
        edit("negative_scale", "scale = 1.0", "scale = -1.0", "scale"),
        edit("infinite_scale", "scale = 1.0", "scale = inf", "scale"),
        edit("scale_is_no_number", "scale = 1.0", "scale = nan", "scale"),
        edit("scale_beyond_floats", "scale = 1.0", "scale = 1e39", "scale"),
        edit("other_channels", "\"B\"", "\"X\"", "specular.R"),
        edit("polarised_channels",
             "[\"R\", \"G\", \"B\"]",
             "[\"specular.R\", \"specular.G\", \"specular.B\", \"diffuse.R\", \"diffuse.G\", "
             "\"diffuse.B\"]",
             "samples"),
        edit("wider", "width = 3", "width = 4", "samples"),
        edit("no_width", "width = 3", "width = 0", "width"),
        edit("width_is_text", "width = 3", "width = \"3\"", "width"),
        edit("negative_pitch", "texel_pitch_mm = 0.25", "texel_pitch_mm = -1.0", "texel_pitch_mm"),
        Damage{"one_more_light",
               [](const fs::path& set) {
                 std::string text = *read_text(set / "lights.csv");
                 ASSERT_TRUE(write_text(set / "lights.csv", text + "33,44\n"));
               },
               Errc::kBadFormat,
               "samples"},
        Damage{"equal_lights",
               [](const fs::path& set) {
                 ASSERT_TRUE(write_text(set / "lights.csv", "theta,phi\n10,20\n30,40\n10,20\n"));
               },
               Errc::kBadFormat,
               "equal"},
        Damage{"truncated",
               [](const fs::path& set) {
                 fs::resize_file(set / "samples.safetensors",
                                 fs::file_size(set / "samples.safetensors") - 8);
               },
               Errc::kBadFormat,
               "samples.safetensors"},
        Damage{"no_safetensors",
               [](const fs::path& set) {
                 ASSERT_TRUE(write_text(set / "samples.safetensors", "not a tensor at all"));
               },
               Errc::kBadFormat,
               "samples.safetensors"}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

}  // namespace
}  // namespace veneer::btf
