// SPDX-License-Identifier: Apache-2.0
#include "daemon/first_start.h"

#include <string>
#include <string_view>
#include <system_error>

namespace veneer::daemon {
namespace {

/// A key that is not there at all is another mistake, of which the reader speaks.
bool is_missing(const std::filesystem::path& path) {
  std::error_code error;
  return !path.empty() && !std::filesystem::exists(path, error);
}

void add_missing(std::string& missing,
                 std::string_view what,
                 const std::filesystem::path& path,
                 std::string_view cure) {
  missing += fmt::format("\n  {} {}: {}", what, path.string(), cure);
}

}  // namespace

Status check_files_are_there(const Config& config) {
  std::string missing;
  if (is_missing(config.scene)) {
    add_missing(missing,
                "scene",
                config.scene,
                "say in it which object stands where, who looks and by what light; begin with "
                "demo/scene.toml of the examples");
  }
  if (!config.quality.ladder.empty() && is_missing(config.quality.ladder)) {
    add_missing(
        missing,
        "quality.ladder",
        config.quality.ladder,
        "\"veneer trade SET.btfset --scene SCENE.toml --profile FOLDER -o FOLDER\" makes one");
  }
  if (config.quality.ladder.empty() && is_missing(config.material)) {
    add_missing(missing,
                "material",
                config.material,
                "\"veneer fit SET.btfset --model texel-colours -o FILE\" makes one");
  }
  // A folder of older profiles counts too: the newest good one of them is drawn with.
  if (is_missing(config.profile) && is_missing(config.profile.string() + ".history")) {
    add_missing(missing,
                "profile",
                config.profile,
                "\"veneer calibrate --rig RIG.toml -o FOLDER\" measures the projector");
  }
  if (missing.empty()) return {};
  return fail(Errc::kNotFound,
              "starting: there is nothing to show yet. What the configuration names is not there, "
              "or user veneer may not look there:{}",
              missing);
}

}  // namespace veneer::daemon
