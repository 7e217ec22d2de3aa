// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "btf/sample_set.h"

// What reading and writing a sample set have in common.
namespace veneer::btf::internal {

inline constexpr const char* kTomlName = "set.toml";
inline constexpr const char* kViewsName = "views.csv";
inline constexpr const char* kLightsName = "lights.csv";
inline constexpr const char* kSamplesName = "samples.safetensors";
inline constexpr const char* kTensorName = "samples";
/// Views, and lights, of one set. Measurements have some hundreds (81 and 151 in Bonn); what is
/// looked up and compared among them takes the square of their number.
inline constexpr std::size_t kMostDirections = 5000;

[[nodiscard]] const std::vector<std::string>& channel_names(bool polarised);
/// The shape of the tensor: [texel][view][light][channel].
[[nodiscard]] std::vector<std::int64_t> sample_shape(const SampleSetInfo& info);
/// Refuses, with `code`, sizes out of range and directions that are none, too many, equal, not of
/// unit length or below the horizon.
[[nodiscard]] Status check_info(const SampleSetInfo& info, Errc code, std::string_view doing);

}  // namespace veneer::btf::internal
