// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/importers/importer.h"
#include "btf/sample_set.h"

// Small things that several tests of importers need.
namespace veneer::btf::testing {

/// The bytes of a number, little-endian, appended to a file's.
template <class Number>
void put(std::string& bytes, Number value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  ASSERT_TRUE(file.good());
}

/// One importer, a file for it and the set that it writes.
class ImportedFile {
 public:
  ImportedFile(std::string_view importer, const std::string& name)
      : importer_(*find_importer(importer).value()), path_(folder_.path() / name) {}
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path out() const { return folder_.path() / "out.btfset"; }
  Status import(const ImportOptions& options = {}) const {
    SilentProgress progress;
    return importer_.run(path_, out(), options, progress);
  }
  /// Imports what must be good.
  [[nodiscard]] SampleSet set(const ImportOptions& options = {}) const {
    const Status status = import(options);
    VENEER_CHECK(status || (std::fputs(status.error().what.c_str(), stderr), false));
    auto opened = SampleSet::open(out());
    VENEER_CHECK(opened);
    return *opened;
  }
  /// The file is refused for its content, by name, and nothing is left behind.
  void expect_refused(const std::string& says, Errc code = Errc::kBadFormat) const {
    std::filesystem::remove_all(out());
    const Status status = import();
    ASSERT_FALSE(status) << says;
    EXPECT_EQ(status.error().code, code) << status.error().what;
    EXPECT_NE(status.error().what.find(says), std::string::npos) << says << "\n"
                                                                 << status.error().what;
    EXPECT_NE(status.error().what.find(path_.filename().string()), std::string::npos)
        << status.error().what;
    EXPECT_FALSE(std::filesystem::exists(out())) << "a half-written set";
  }
  void write(const std::string& bytes) const { write_bytes(path_, bytes); }
  /// A file that ends anywhere is refused.
  void expect_cuts_refused(const std::string& bytes, std::size_t step = 1) const {
    for (std::size_t size = 0; size < bytes.size(); size += step) {
      write(bytes.substr(0, size));
      const Status status = import();
      ASSERT_FALSE(status) << "cut to " << size << " of " << bytes.size() << " bytes";
      ASSERT_FALSE(std::filesystem::exists(out()));
    }
    std::string longer = bytes;
    longer.push_back('\0');
    write(longer);
    EXPECT_FALSE(import()) << "a byte too many";
  }
  /// Whatever happens to a few bytes of the first `reach`, the file is refused or becomes a set of
  /// finite samples.
  void expect_flips_survived(const std::string& bytes, std::size_t reach, int rounds) const {
    Pcg32 random(7);
    for (int round = 0; round < rounds; ++round) {
      std::string damaged = bytes;
      const std::uint32_t flips = 1 + random.next() % 4;
      for (std::uint32_t i = 0; i < flips; ++i) {
        // Bits that are set and whole bytes: high bytes of counts make huge ones.
        char& byte = damaged[random.next() % reach];
        byte = random.next() % 2 == 0 ? static_cast<char>(random.next())
                                      : static_cast<char>(byte ^ (1 << (random.next() % 8)));
      }
      write(damaged);
      std::filesystem::remove_all(out());
      if (const Status status = import()) {
        const auto opened = SampleSet::open(out());
        ASSERT_TRUE(opened) << round << ": " << opened.error().what;
        ASSERT_TRUE(opened->check_finite()) << round;
      } else {
        ASSERT_FALSE(std::filesystem::exists(out())) << round;
      }
    }
  }

 private:
  TemporaryFolder folder_;
  const Importer& importer_;
  std::filesystem::path path_;
};

/// The samples of a texel in float.
inline std::vector<float> samples_of(const SampleSet& set, int texel = 0) {
  std::vector<float> rgb(static_cast<std::size_t>(set.info().pair_count()) * 3);
  set.rgb(texel, Part::kTotal, rgb);
  return rgb;
}

}  // namespace veneer::btf::testing
