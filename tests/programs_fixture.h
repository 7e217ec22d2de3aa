// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "tests/program.h"

namespace veneer {

/// A tiny polarised sample set, a material fitted to it, a profile and a run's configuration, made
/// once by the programs themselves.
class ProgramsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const std::string here = folder_->path().string();
    const std::string etc = VENEER_ETC;
    for (const std::string& line :
         {"veneer synthesize cloth --size 8 --views 25 --lights 25 --samples 1 -o " + here +
              "/cloth.btfset",
          "veneer fit " + here +
              "/cloth.btfset --model texel-colours --components 3+1 --clusters 2 --angular 8 -o " +
              here + "/material.safetensors",
          "veneer calibrate --yes --board-poses 5 --bench " + etc + "/benches/demo.toml -o " +
              here + "/profile"}) {
      const Outcome outcome = run(line);
      ASSERT_EQ(outcome.exit_code, 0) << line << "\n" << outcome.err;
    }
    for (const char* name : {"veneer.toml", "scene.toml"}) {
      ASSERT_TRUE(write_text(folder_->path() / name,
                             read_text(std::filesystem::path(etc) / "demo" / name).value()));
    }
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::filesystem::path at(const std::string& name) { return folder_->path() / name; }
  static std::string text(const std::string& name) { return at(name).string(); }
  /// A copy of the sample set that a test may damage.
  static std::filesystem::path copy_of_set(const std::string& name) {
    std::filesystem::remove_all(at(name));
    std::filesystem::copy(at("cloth.btfset"), at(name), std::filesystem::copy_options::recursive);
    return at(name);
  }
  /// Puts a copy of the profile in a place, as a calibration does.
  static void publish_profile(const std::string& name) {
    StagedFolder staged = StagedFolder::create(at(name)).value();
    for (const auto& entry : std::filesystem::directory_iterator(at("profile")))
      std::filesystem::copy(entry.path(), staged.path() / entry.path().filename());
    ASSERT_TRUE(staged.commit());
  }
  static void cut_in_half(const std::filesystem::path& file) {
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  }

  static inline TemporaryFolder* folder_ = nullptr;
};

}  // namespace veneer
