// SPDX-License-Identifier: Apache-2.0
#include "base/report_page.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace veneer {
namespace {

TEST(ReportPage, NoTextCanEndTheScriptThatHoldsIt) {
  const nlohmann::ordered_json data{{"name", "a</script><b>"}, {"bytes", "\xff"}};
  const std::string page = page_with_data("<script>{{DATA}}</script>", data);
  EXPECT_EQ(page.find("</script>"), page.size() - std::string("</script>").size());
  const std::size_t begin = page.find('{');
  const std::string text = page.substr(begin, page.rfind('}') + 1 - begin);
  const nlohmann::json back = nlohmann::json::parse(text);
  EXPECT_EQ(back.at("name"), "a</script><b>");
  EXPECT_EQ(back.at("bytes"), "\xef\xbf\xbd");  // the mark of what is no UTF-8
}

}  // namespace
}  // namespace veneer
