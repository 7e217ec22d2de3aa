// SPDX-License-Identifier: Apache-2.0
#include "base/report_page.h"

#include <nlohmann/json.hpp>

#include "base/result.h"

namespace veneer {

std::string page_with_data(std::string_view page, const nlohmann::ordered_json& data) {
  constexpr std::string_view kPlace = "{{DATA}}";
  std::string text = data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  std::string filled(page);
  const std::size_t place = filled.find(kPlace);
  VENEER_CHECK(place != std::string::npos);
  return filled.replace(place, kPlace.size(), text);
}

}  // namespace veneer
