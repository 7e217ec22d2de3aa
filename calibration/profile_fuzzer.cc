// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "base/files.h"
#include "base/testing/fuzzing.h"
#include "base/testing/temporary_folder.h"
#include "calibration/profile.h"

namespace veneer::calibration {
namespace {

using Json = nlohmann::json;

ProjectorProfile small_profile() {
  ProjectorProfile profile;
  profile.geometry = {4, 3, 5, 5, 2, 1.5, {}};
  profile.bits = 2;
  for (auto& curve : profile.tone_curves) curve = {0, 0.25, 0.5, 1};
  profile.vignetting = Image<float>(1, 1, 1.0F);
  return profile;
}

/// A folder with a good profile, whose profile.json is written over again and again.
const std::filesystem::path& folder() {
  static const TemporaryFolder kFolder;
  static const std::filesystem::path kProfile = [] {
    const std::filesystem::path path = kFolder.path() / "profile";
    VENEER_CHECK(small_profile().save(path).has_value());
    return path;
  }();
  return kProfile;
}

/// The manifest with the checksum that its contents have: what an attacker or a bug could write.
std::string with_checksum(const std::string& text) {
  Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("profile")) return text;
  try {
    const std::string profile = json["profile"].dump();
    const uLong crc = crc32_z(0, reinterpret_cast<const Bytef*>(profile.data()), profile.size());
    json["checksum"] = fmt::format("crc32:{:08x}", crc);
    return json.dump();
  } catch (const Json::exception&) {
    return text;
  }
}

/// What was loaded passes its own check.
Verdict read(std::string_view text) {
  Verdict verdict;
  for (const std::string& manifest : {with_checksum(std::string(text)), std::string(text)}) {
    std::ofstream(folder() / "profile.json", std::ios::binary) << manifest;
    const auto profile = ProjectorProfile::load(folder());
    verdict = profile ? accepted(profile->check() ? "" : "what was loaded does not pass")
                      : refused(profile.error());
    if (!verdict.broken.empty()) break;
  }
  return verdict;
}

}  // namespace
}  // namespace veneer::calibration

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace calibration;
  static const FuzzedReader kReader{
      &read, {read_text(folder() / "profile.json").value_or("{}")}, {16 << 10, 80}};
  return kReader;
}
