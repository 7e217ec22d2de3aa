// SPDX-License-Identifier: Apache-2.0
#include "btf/models/components.h"

#include <algorithm>
#include <charconv>

namespace veneer::btf {

Result<std::vector<int>> parse_components(std::string_view text) {
  std::vector<int> components;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('+', begin), text.size());
    const int least = components.empty() ? 1 : 0;
    int value = 0;
    const auto [stop, error] = std::from_chars(text.data() + begin, text.data() + end, value);
    if (error != std::errc{} || stop != text.data() + end || value < least ||
        value > kMostComponents)
      return fail(
          Errc::kInvalidOption,
          "fit: components is \"{}\"; it must be one number for each term of the model, joined "
          "by +, each 1 to {}, or 0 for a second one that is left out: for instance 4, 3+1 or 4+0",
          text,
          kMostComponents);
    components.push_back(value);
    begin = end + 1;
  }
  return components;
}

Result<int> parse_one_term(std::string_view text, std::string_view model) {
  VENEER_ASSIGN(const std::vector<int> components, parse_components(text));
  if (components.size() == 1) return components.front();
  return fail(Errc::kInvalidOption,
              "fit: components is \"{}\"; {} takes one number, for instance 4",
              text,
              model);
}

Result<std::array<int, 2>> parse_two_terms(std::string_view text, std::string_view model) {
  VENEER_ASSIGN(const std::vector<int> components, parse_components(text));
  if (components.size() == 2) return std::array{components[0], components[1]};
  if (components.size() == 1 && components.front() >= 2) {
    const int second = std::max(1, components.front() / 4);
    return std::array{components.front() - second, second};
  }
  return fail(Errc::kInvalidOption,
              "fit: components is \"{}\"; {} takes two numbers, for instance 3+1, or their sum",
              text,
              model);
}

Status refuse_form(const FitOptions& options, std::string_view model) {
  for (const auto& [name, value] :
       {std::pair{"specular", &options.specular}, std::pair{"clustering", &options.clustering}})
    if (!value->empty())
      return fail(Errc::kInvalidOption,
                  "fit: {} is \"{}\"; {} offers no choice of it, leave it out",
                  name,
                  *value,
                  model);
  if (options.form.empty()) return {};
  return fail(Errc::kInvalidOption,
              "fit: form is \"{}\"; {} has only one form, leave it out",
              options.form,
              model);
}

Status refuse_mip_levels(const FitOptions& options, std::string_view model) {
  if (options.mip_levels == 1) return {};
  return fail(Errc::kInvalidOption,
              "fit: mip_levels is {}; {} has no mip levels, only texel-colours has: leave it out",
              options.mip_levels,
              model);
}

Status refuse_precision(const FitOptions& options, std::string_view model) {
  if (options.precision.empty()) return {};
  return fail(Errc::kInvalidOption,
              "fit: precision is \"{}\"; {} has only one, leave it out",
              options.precision,
              model);
}

Result<Precision> parse_precision(std::string_view text,
                                  Precision otherwise,
                                  std::string_view model) {
  if (text.empty()) return otherwise;
  for (const Precision precision : {Precision::k8Bit, Precision::kFloat16})
    if (text == name_of(precision)) return precision;
  return fail(Errc::kInvalidOption,
              "fit: precision is \"{}\"; {} knows {} and {}",
              text,
              model,
              name_of(Precision::k8Bit),
              name_of(Precision::kFloat16));
}

Result<Precision> read_precision(const SafetensorsFile& file, std::string_view model) {
  VENEER_ASSIGN(const std::string text, file.meta("precision"));
  // What options may leave open, a file may not.
  const auto precision = parse_precision(text.empty() ? "none" : text, Precision::k8Bit, model);
  if (precision) return *precision;
  return fail(Errc::kBadFormat, "reading {}: {}", file.path().string(), precision.error().what);
}

std::string_view name_of(Precision precision) {
  return precision == Precision::k8Bit ? "8bit" : "float16";
}

std::string format_components(const std::array<int, 2>& components) {
  return fmt::format("{}+{}", components[0], components[1]);
}

}  // namespace veneer::btf
