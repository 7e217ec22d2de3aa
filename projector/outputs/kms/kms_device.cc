// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/kms_device.h"

#include <algorithm>
#include <charconv>

namespace veneer::projector {

std::vector<std::filesystem::path> kms_device_paths() {
  std::vector<std::pair<int, std::filesystem::path>> cards;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/dri", absent)) {
    const std::string name = entry.path().filename().string();
    constexpr std::string_view kPrefix = "card";
    int number = 0;
    if (!name.starts_with(kPrefix)) continue;
    const char* end = name.data() + name.size();
    const auto parsed = std::from_chars(name.data() + kPrefix.size(), end, number);
    if (parsed.ec == std::errc{} && parsed.ptr == end) cards.emplace_back(number, entry.path());
  }
  std::ranges::sort(cards);
  std::vector<std::filesystem::path> paths;
  for (auto& [number, path] : cards) paths.push_back(std::move(path));
  return paths;
}

const KmsProperty* find_property(std::span<const KmsProperty> properties, std::string_view name) {
  const auto found = std::ranges::find(properties, name, &KmsProperty::name);
  return found == properties.end() ? nullptr : &*found;
}

std::optional<std::uint64_t> find_choice(const KmsProperty& property, std::string_view choice) {
  for (const auto& [name, value] : property.choices) {
    if (name == choice) return value;
  }
  return std::nullopt;
}

}  // namespace veneer::projector
