// SPDX-License-Identifier: Apache-2.0
#include "base/report_page.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace veneer {
namespace {

TEST(ReportPage, NoTextCanEndTheScriptThatHoldsIt) {
  const nlohmann::ordered_json data{{"name", "a</script><b>"}, {"bytes", "\xff"}};
  const std::string page = page_with_data("{{HEAD}}<script>{{DATA}}</script>", data);
  EXPECT_EQ(page.find("</script>"), page.size() - std::string("</script>").size());
  const std::size_t begin = page.find("<script>") + std::string("<script>").size();
  const std::string text = page.substr(begin, page.rfind('}') + 1 - begin);
  const nlohmann::json back = nlohmann::json::parse(text);
  EXPECT_EQ(back.at("name"), "a</script><b>");
  EXPECT_EQ(back.at("bytes"), "\xef\xbf\xbd");  // the mark of what is no UTF-8
}

TEST(ReportPage, HasTheStylesOfAllReportsAndLeavesTheDataAsTheyAre) {
  const nlohmann::ordered_json data{{"name", "{{HEAD}} and {{DATA}}"}};
  const std::string page =
      page_with_data("<head>\n{{HEAD}}\n</head><script>{{DATA}}</script>", data);
  EXPECT_TRUE(page.starts_with("<head>\n<meta charset=\"utf-8\">\n"));
  EXPECT_LT(page.find("<style>"), page.find("</head>"));
  EXPECT_TRUE(page.ends_with("<script>{\"name\":\"{{HEAD}} and {{DATA}}\"}</script>")) << page;
}

}  // namespace
}  // namespace veneer
