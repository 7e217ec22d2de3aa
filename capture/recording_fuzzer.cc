// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/result.h"
#include "capture/internal_plan_json.h"
#include "capture/internal_recording.h"

/// A session's journal, or the plan of its session.json. What is understood is understood again
/// from its own text.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace veneer::capture;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  Journal journal;
  if (const auto understood = journal.take(text)) {
    Journal again;
    VENEER_CHECK(*understood <= size &&
                 again.take(text.substr(0, *understood)).value_or(size + 1) == *understood);
    VENEER_CHECK(again.pictures.size() == journal.pictures.size() && again.notes == journal.notes);
  }
  const auto plan = plan_from(nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false));
  if (plan) VENEER_CHECK(plan_from(json_of(*plan)).has_value());
  return 0;
}
