// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs.h"

#include <algorithm>
#include <array>
#include <string>

#include "projector/outputs/file/file_output.h"
#include "projector/outputs/kms/kms_output.h"
#include "projector/outputs/null/null_output.h"
#include "projector/outputs/window/window_output.h"

namespace veneer::projector {
namespace {

template <class T>
Result<std::unique_ptr<Output>> open_as_output(TomlReader& config,
                                               const std::filesystem::path& state_directory) {
  if constexpr (requires { T::open(config, state_directory); }) {
    return T::open(config, state_directory);
  } else {
    return T::open(config);
  }
}

constexpr std::array kOutputs{
    OutputDriver{
        "file", "PNG files of the drive codes, EXR of the target", &open_as_output<FileOutput>},
    OutputDriver{
        "kms", "a display of a graphics card, without a desktop", &open_as_output<KmsOutput>},
    OutputDriver{"null", "nowhere, for timing", &open_as_output<NullOutput>},
    OutputDriver{"window", "a window on the desktop", &open_as_output<WindowOutput>},
};
static_assert(std::ranges::is_sorted(kOutputs, {}, &OutputDriver::name));

}  // namespace

std::span<const OutputDriver> output_drivers() { return kOutputs; }

Result<std::unique_ptr<Output>> open_output(TomlReader& config,
                                            const std::filesystem::path& state_directory) {
  std::string name;
  config.read("driver", name);
  const auto driver = std::ranges::find(kOutputs, name, &OutputDriver::name);
  if (driver != kOutputs.end()) return driver->open(config, state_directory);
  std::string known;
  for (const OutputDriver& each : kOutputs) known += fmt::format(" \"{}\"", each.name);
  return fail(Errc::kInvalidOption,
              "opening the output: no output is called \"{}\"; set driver to one of{}",
              name,
              known);
}

}  // namespace veneer::projector
