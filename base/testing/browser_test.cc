// SPDX-License-Identifier: Apache-2.0
#include "base/testing/browser.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace veneer {
namespace {

using nlohmann::json;

TEST(Browser, ShowsAPageAndWhatAHandDidToIt) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const auto seen = seen_in_browser(
      "<html><head></head><body><button>a &amp; b</button><p></p><script>"
      "document.querySelector('button').addEventListener('click', () => {"
      " document.querySelector('p').textContent = '</pre> \u00e4 &lt;'; });"
      "</script></body></html>",
      "document.querySelector('button').click();"
      "return [document.querySelector('p').textContent,"
      " document.querySelector('button').textContent];");
  ASSERT_TRUE(seen) << seen.error().what;
  const json expected{{"found", {"</pre> \u00e4 &lt;", "a & b"}}, {"faults", json::array()}};
  EXPECT_EQ(json::parse(*seen), expected);
}

TEST(Browser, TellsOfErrorsOfThePageAndOfWhatItAskedForElsewhere) {
  if (!has_browser()) GTEST_SKIP() << kNoBrowser;
  const auto seen = seen_in_browser(
      "<html><head><link rel='stylesheet' href='http://127.0.0.1:9/style.css'></head><body>"
      "<img src='http://127.0.0.1:9/picture.png'><img src='beside.png'>"
      "<script>fetch('http://127.0.0.1:9/data').catch(() => {});</script>"
      "<script>console.error('a sigh', 3);</script><script>absent();</script>"
      "<script>Promise.reject('a promise');</script></body></html>",
      "await new Promise(done => setTimeout(done, 500)); throw Error('a slip');");
  ASSERT_TRUE(seen) << seen.error().what;
  const std::string faults = json::parse(*seen)["faults"].dump();
  for (const char* fault : {"asked for http://127.0.0.1:9/style.css",
                            "asked for http://127.0.0.1:9/picture.png",
                            "asked for http://127.0.0.1:9/data",
                            "beside.png",
                            "a sigh 3",
                            "absent is not defined",
                            "a promise",
                            "a slip"})
    EXPECT_NE(faults.find(fault), std::string::npos) << fault << "\n" << faults;
}

TEST(Browser, RefusesWhatIsNoPage) {
  const auto seen = seen_in_browser("a text", "");
  ASSERT_FALSE(seen);
  EXPECT_EQ(seen.error().what, "opening a page: it has no <head> or no </body>");
}

}  // namespace
}  // namespace veneer
