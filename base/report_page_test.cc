// SPDX-License-Identifier: Apache-2.0
#include "base/report_page.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/testing/browser.h"

namespace veneer {
namespace {

TEST(ReportPage, NoTextCanEndTheScriptThatHoldsIt) {
  const nlohmann::ordered_json data{{"name", "a</script><b>"}, {"bytes", "\xff"}};
  const std::string page = page_with_data("{{HEAD}}<script>data: {{DATA}}</script>", data);
  const std::size_t begin = page.find("data: ") + std::string("data: ").size();
  EXPECT_EQ(page.find("</script>", begin), page.size() - std::string("</script>").size());
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

TEST(ReportPage, AxesBearRoundValuesWithinTheirEnds) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const auto seen = seen_in_browser(
      page_with_data("<html><head>{{HEAD}}</head><body><!-- {{DATA}} --></body></html>", {}),
      "return [roundTicks(0, 16.1), roundTicks(-0.31, 0.52, 3), roundTicks(0, 1e-7, 2), "
      "roundTicks(3, 3), roundTicks(2, 1), roundTicks(0, Infinity), roundTicks(NaN, 1)];");
  ASSERT_TRUE(seen) << seen.error().what;
  const nlohmann::json expected = {{"found",
                                    {{0, 5, 10, 15},
                                     {0, 0.5},
                                     {0, 5e-8, 1e-7},
                                     nlohmann::json::array(),
                                     nlohmann::json::array(),
                                     nlohmann::json::array(),
                                     nlohmann::json::array()}},
                                   {"faults", nlohmann::json::array()}};
  EXPECT_EQ(nlohmann::json::parse(*seen), expected) << *seen;
}

}  // namespace
}  // namespace veneer
