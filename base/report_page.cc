// SPDX-License-Identifier: Apache-2.0
#include "base/report_page.h"

#include <nlohmann/json.hpp>

#include "base/result.h"

namespace veneer {
namespace {

constexpr char kHead[] =
#include "base/report_page_head.html.inc"
    ;

// Where `place` is, which is once, stands `text`.
void fill(std::string& page, std::string_view place, std::string_view text) {
  const std::size_t at = page.find(place);
  VENEER_CHECK(at != std::string::npos);
  page.replace(at, place.size(), text);
}

}  // namespace

std::string page_with_data(std::string_view page, const nlohmann::ordered_json& data) {
  std::string text = data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  std::string filled(page);
  // The head first: the data may hold any text.
  fill(filled, "{{HEAD}}", kHead);
  fill(filled, "{{DATA}}", text);
  return filled;
}

}  // namespace veneer
