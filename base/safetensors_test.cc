// SPDX-License-Identifier: Apache-2.0
#include "base/safetensors.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

/// A file with the header `json`, padded so that the data are aligned, and `body` bytes of data.
void write_raw(const fs::path& path, std::string json, std::size_t body) {
  json.resize((json.size() + 7) / 8 * 8, ' ');
  std::string text(8, '\0');
  const std::uint64_t length = json.size();
  std::memcpy(text.data(), &length, 8);
  ASSERT_TRUE(write_text(path, text + json + std::string(body, '\0')));
}

void write_example(const fs::path& path) {
  auto writer = SafetensorsWriter::create(
      path,
      {{"a", DType::kF32, {2, 3}}, {"empty", DType::kF64, {0, 5}}, {"b", DType::kU8, {5}}},
      {{"model", "x"}});
  ASSERT_TRUE(writer) << writer.error().what;
  const std::span<float> a = writer->tensor<float>("a");
  std::iota(a.begin(), a.end(), 1.0F);
  const std::span<std::uint8_t> b = writer->tensor<std::uint8_t>("b");
  std::iota(b.begin(), b.end(), std::uint8_t{10});
  EXPECT_FALSE(fs::exists(path)) << "nothing is there before finish()";
  ASSERT_TRUE(writer->finish());
}

TEST(Safetensors, RoundTrips) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "x.safetensors";
  write_example(path);
  const SafetensorsFile file = SafetensorsFile::open(path).value();
  EXPECT_EQ(file.meta("model").value(), "x");
  EXPECT_FALSE(file.meta("colour"));
  const auto a = file.tensor("a", DType::kF32, {2, -1}).value().as<float>();
  EXPECT_EQ(std::vector<float>(a.begin(), a.end()), (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(file.tensor("b", DType::kU8, {5}).value().as<std::uint8_t>()[4], 14);
  EXPECT_EQ(file.tensor("empty", DType::kF64, {0, 5}).value().count(), 0);
}

TEST(Safetensors, ViewsOutliveTheirFirstOwner) {
  const TemporaryFolder folder;
  write_example(folder.path() / "x");
  SafetensorsFile first = SafetensorsFile::open(folder.path() / "x").value();
  const TensorView view = first.tensor("a", DType::kF32, {}).value();
  const SafetensorsFile second = std::move(first);
  EXPECT_EQ(view.as<float>()[5], 6.0F);
}

TEST(Safetensors, SaysWhatItFoundAndExpected) {
  const TemporaryFolder folder;
  write_example(folder.path() / "x");
  const SafetensorsFile file = SafetensorsFile::open(folder.path() / "x").value();
  const Result<TensorView> wrong = file.tensor("a", DType::kF16, {3, -1});
  ASSERT_FALSE(wrong);
  const std::string& what = wrong.error().what;
  EXPECT_NE(what.find("F32 [2 x 3]"), std::string::npos) << what;
  EXPECT_NE(what.find("F16 [3 x any]"), std::string::npos) << what;
  EXPECT_EQ(file.tensor("nobody", DType::kF16, {}).error().code, Errc::kBadFormat);
}

TEST(Safetensors, RefusesEveryTruncation) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "x";
  write_example(path);
  const std::string whole = read_text(path).value();
  for (std::size_t kept = 0; kept < whole.size(); ++kept) {
    ASSERT_TRUE(write_text(path, whole.substr(0, kept)));
    const auto file = SafetensorsFile::open(path);
    ASSERT_FALSE(file) << kept << " of " << whole.size() << " bytes";
    EXPECT_EQ(file.error().code, Errc::kBadFormat);
  }
}

TEST(Safetensors, RefusesHeadersThatLie) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "x";
  for (
      const char* json : {
          R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,16]}})",   // shape and bytes differ
          R"({"a":{"dtype":"F32","shape":[-4],"data_offsets":[0,16]}})",  // negative extent
          R"({"a":{"dtype":"F32","shape":[4],"data_offsets":[16,0]}})",   // backwards
          R"({"a":{"dtype":"F32","shape":[4],"data_offsets":[0,16,16]}})",  // three offsets
          R"({"a":{"dtype":"BF16","shape":[8],"data_offsets":[0,16]}})",    // a type we do not read
          R"({"a":{"dtype":"F32","shape":[4611686018427387904,4],"data_offsets":[0,16]}})",  // overflow
          R"({"a":{"dtype":"F16","shape":[720368542036854775807],"data_offsets":[0,0]}})",  // 7e20
          R"({"a":{"dtype":"F32","shape":[4.0],"data_offsets":[0,16]}})",
          R"({"a":{"dtype":"F32","shape":[4],"data_offsets":[0,1e30]}})",
          R"({"a":{"shape":[4],"data_offsets":[0,16]}})",            // no type
          R"({"a":{"dtype":7,"shape":[4],"data_offsets":[0,16]}})",  // a type that is no text
          R"({"a":3})",
          R"([1,2])",
          R"({"a")",
      }) {
    write_raw(path, json, 16);
    const auto file = SafetensorsFile::open(path);
    ASSERT_FALSE(file) << json;
    EXPECT_EQ(file.error().code, Errc::kBadFormat) << json;
  }
}

TEST(Safetensors, ReadsTensorsOnlyWhereTheyFillTheFile) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "x";
  // Two tensors of 8 bytes and an empty one in a body of 16 bytes.
  const auto open = [&](int a, int b, int empty) {
    write_raw(path,
              fmt::format(R"({{"a":{{"dtype":"F32","shape":[2],"data_offsets":[{},{}]}},)"
                          R"("e":{{"dtype":"F32","shape":[0],"data_offsets":[{},{}]}},)"
                          R"("b":{{"dtype":"F32","shape":[2],"data_offsets":[{},{}]}}}})",
                          a,
                          a + 8,
                          empty,
                          empty,
                          b,
                          b + 8),
              16);
    return SafetensorsFile::open(path);
  };
  const auto refused = [&](int a, int b, int empty, std::string_view why) {
    const auto file = open(a, b, empty);
    return !file && file.error().code == Errc::kBadFormat &&
           file.error().what.find(why) != std::string::npos;
  };
  for (const int empty : {0, 8}) {
    EXPECT_TRUE(open(0, 8, empty)) << empty;
    EXPECT_TRUE(open(8, 0, empty)) << empty;
  }
  EXPECT_TRUE(refused(0, 4, 0, "overlap"));
  EXPECT_TRUE(refused(0, 0, 0, "overlap"));
  EXPECT_TRUE(refused(4, 8, 4, "overlap"));
  EXPECT_TRUE(refused(0, 8, 4, "overlap"));
  write_raw(path, R"({"a":{"dtype":"U8","shape":[9],"data_offsets":[0,9]}})", 16);
  const auto longer = SafetensorsFile::open(path);
  ASSERT_FALSE(longer);
  EXPECT_NE(longer.error().what.find("7 bytes follow"), std::string::npos) << longer.error().what;
}

TEST(Safetensors, RefusesAnAbsurdHeaderLength) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "x", std::string(8, '\xff') + "{}"));
  EXPECT_EQ(SafetensorsFile::open(folder.path() / "x").error().code, Errc::kBadFormat);
}

TEST(Safetensors, RefusesFoldersAndMissingFiles) {
  const TemporaryFolder folder;
  EXPECT_FALSE(SafetensorsFile::open(folder.path()));
  EXPECT_EQ(SafetensorsFile::open(folder.path() / "none").error().code, Errc::kNotFound);
}

TEST(SafetensorsWriter, TakesMetadataThatAreNotUtf8) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "x";
  auto writer = SafetensorsWriter::create(path, {{"a", DType::kF32, {1}}}, {{"from", "caf\xe9/"}});
  ASSERT_TRUE(writer) << writer.error().what;
  ASSERT_TRUE(writer->finish());
  EXPECT_EQ(SafetensorsFile::open(path).value().meta("from").value(), "caf\xef\xbf\xbd/");
}

TEST(SafetensorsWriter, LeavesNothingWhenAbandoned) {
  const TemporaryFolder folder;
  { auto writer = SafetensorsWriter::create(folder.path() / "x", {{"a", DType::kF32, {4}}}, {}); }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace veneer
