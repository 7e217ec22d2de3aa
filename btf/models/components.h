// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "btf/material.h"

namespace veneer::btf {

/// Most Eigen-BRDFs of one term.
inline constexpr int kMostComponents = 16;

/// Reads "4" or "3+1": one number for each term, each 1 to kMostComponents; a second term may be
/// left out by 0.
/// Errors: kInvalidOption, saying what is expected.
[[nodiscard]] Result<std::vector<int>> parse_components(std::string_view text);

/// The number for a model of one term. Errors: kInvalidOption.
[[nodiscard]] Result<int> parse_one_term(std::string_view text, std::string_view model);

/// The numbers for a model of two terms. A single number n >= 2 is split three to one, as suits
/// most materials: "4" is "3+1", "8" is "6+2". Errors: kInvalidOption.
[[nodiscard]] Result<std::array<int, 2>> parse_two_terms(std::string_view text,
                                                         std::string_view model);

/// For models of one form, whose terms are kept in one way. Errors: kInvalidOption where the
/// options ask for another.
[[nodiscard]] Status refuse_form(const FitOptions& options, std::string_view model);

/// For models that keep everything in one precision. Errors: kInvalidOption.
[[nodiscard]] Status refuse_precision(const FitOptions& options, std::string_view model);

/// For models without mip levels. Errors: kInvalidOption.
[[nodiscard]] Status refuse_mip_levels(const FitOptions& options, std::string_view model);

/// Kinds of FitOptions::precision.
enum class Precision { k8Bit, kFloat16 };
/// `otherwise` where the options leave it open. Errors: kInvalidOption.
[[nodiscard]] Result<Precision> parse_precision(std::string_view text,
                                                Precision otherwise,
                                                std::string_view model);
[[nodiscard]] std::string_view name_of(Precision precision);
/// The metadata entry "precision" of a material. Errors: kBadFormat.
[[nodiscard]] Result<Precision> read_precision(const SafetensorsFile& file, std::string_view model);

/// "3+1" again.
[[nodiscard]] std::string format_components(const std::array<int, 2>& components);

}  // namespace veneer::btf
