// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <map>
#include <string>

#include "base/result.h"
#include "btf/sample_set.h"
#include "quality/plan/plan.h"

namespace veneer::quality {

/// Where a plan came from, for people.
struct PlanSource {
  std::string set;
  std::string scene;
  std::string profile;
};

/// The reach in one line, for people and for a material's metadata.
[[nodiscard]] std::string region_in_words(const Reach& reach);

/// What was found, tried, dropped and saved, in some lines.
[[nodiscard]] std::string plan_text(const Plan& plan);

/// The same as numbers: docs/howto/plan.md lists the keys.
[[nodiscard]] nlohmann::ordered_json plan_json(const Plan& plan, const PlanSource& source);

/// What a planned material's metadata say beside what every fit's do.
[[nodiscard]] std::map<std::string, std::string> plan_provenance(const Plan& plan,
                                                                 const PlanSource& source,
                                                                 const btf::SampleSetInfo& set);

/// One HTML file that needs no network: the hemispheres of views and lights with what is asked,
/// what was measured and the boxes; the steps as a table. Errors: kIo.
[[nodiscard]] Status write_plan_page(const std::filesystem::path& path,
                                     const Plan& plan,
                                     const PlanSource& source,
                                     const btf::SampleSetInfo& set);

}  // namespace veneer::quality
