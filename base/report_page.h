// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <string_view>

namespace veneer {

/// An HTML page that carries its data: `{{DATA}}` in it, inside a script element, becomes the JSON
/// text, in which nothing can end the element and what is not UTF-8 is replaced.
/// @param page  holds `{{DATA}}` once.
[[nodiscard]] std::string page_with_data(std::string_view page, const nlohmann::ordered_json& data);

}  // namespace veneer
