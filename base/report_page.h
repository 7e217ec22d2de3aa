// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <string_view>

namespace veneer {

/// An HTML page that carries its data and looks as all do: `{{HEAD}}` in its head becomes the
/// styles of every report (report_page_head.html), which its own follow, and `{{DATA}}`, inside a
/// script element, the JSON text, in which nothing can end the element and what is not UTF-8 is
/// replaced.
/// @param page  holds `{{HEAD}}` once, and `{{DATA}}` once after it.
[[nodiscard]] std::string page_with_data(std::string_view page, const nlohmann::ordered_json& data);

}  // namespace veneer
