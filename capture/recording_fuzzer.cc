// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <string_view>

#include "base/result.h"
#include "base/testing/fuzzing.h"
#include "capture/internal_plan_json.h"
#include "capture/internal_recording.h"

namespace veneer::capture {
namespace {

/// A session's journal, or the plan of its session.json. What is understood is understood again
/// from its own text.
Verdict read(std::string_view text) {
  Journal journal;
  if (const auto understood = journal.take(text)) {
    Journal again;
    VENEER_CHECK(*understood <= text.size() &&
                 again.take(text.substr(0, *understood)).value_or(text.size() + 1) == *understood);
    VENEER_CHECK(again.pictures.size() == journal.pictures.size() && again.notes == journal.notes);
  }
  const auto plan = plan_from(nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false));
  if (plan) VENEER_CHECK(plan_from(json_of(*plan)).has_value());
  if (plan || !journal.pictures.empty() || !journal.notes.empty()) return accepted();
  return refused(plan.error());
}

std::string plan_text() {
  CapturePlan plan;
  plan.name = "cloth";
  plan.area.width_mm = 40;
  plan.area.height_mm = 30;
  plan.lights = {btf::Direction(0, 0, 1), btf::Direction(0.6, 0, 0.8)};
  plan.views = {btf::Direction(0, 0, 1)};
  return json_of(plan).dump();
}

}  // namespace
}  // namespace veneer::capture

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace capture;
  static const FuzzedReader kReader{
      &read,
      {plan_text(),
       R"({"picture":{"target":"sample","view":0,"light":1,"analyser":2,"exposure":0,"dark":false,)"
       R"("repeat":false},"bytes":1234,"checksum":"crc32:01234567"})"
       "\n{\"note\":\"size\",\"value\":{\"a\":[1,2.5,null]}}\n"},
      {1024, 72}};
  return kReader;
}
