// SPDX-License-Identifier: Apache-2.0
#include "base/manual/roff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/manual/internal_test_app.h"

namespace veneer::manual {
namespace {

using testing::HasSubstr;
using testing::Not;

Page page_of_fence(int section) {
  Page page;
  page.name = "fence";
  page.section = section;
  return page;
}

TEST(EscapeRoff, LeavesNothingThatRoffWouldAct) {
  // A line that begins with a dot or a quote would be a request, a backslash an escape.
  EXPECT_EQ(escape_roff(".so x"), "\\&.so x");
  EXPECT_EQ(escape_roff("'x"), "\\(aqx");
  EXPECT_EQ(escape_roff("a\\fBb"), "a\\(rsfBb");
  EXPECT_EQ(escape_roff("--no-x"), "\\-\\-no\\-x");
  EXPECT_EQ(escape_roff(""), "");
  // Whatever the text, each backslash of the outcome begins an escape of ours.
  std::string all;
  for (char c = ' '; c < 127; ++c) all += c;
  const std::string escaped = escape_roff(all);
  for (std::size_t at = escaped.find('\\'); at != std::string::npos;
       at = escaped.find('\\', at + 1))
    EXPECT_THAT(std::string("(-&"), HasSubstr(escaped.substr(at + 1, 1))) << escaped.substr(at);
}

TEST(ToRoff, ShowsEveryOptionAndHidesTheHidden) {
  const TestApp test;
  const std::string page = to_roff(usage_of(test.app, "fence"), page_of_fence(1));
  for (const char* shown : {"\\-\\-dry", "\\-\\-colour", "\\-\\-coats", "BOARDS", "\\-\\-with"})
    EXPECT_THAT(page, HasSubstr(shown));
  EXPECT_THAT(page, Not(HasSubstr("secret")));
  EXPECT_THAT(page, HasSubstr("default: green"));
  EXPECT_THAT(page, HasSubstr("fence wash"));
  // The line of the text that begins with a dot is text.
  EXPECT_THAT(page, HasSubstr("nor .black"));
  EXPECT_THAT(page, HasSubstr("don\\(aqt take \\(rswhite\n.br\n"));
}

TEST(ToRoff, SetsTermsAndParagraphs) {
  const TestApp test;
  Page made = page_of_fence(8);
  made.sections = {{"Files", "Where it is.\n\n*/etc/fence: its paint"}};
  made.see_also = {"paint(1)", "brush(7)"};
  const std::string page = to_roff(usage_of(test.app, "fence"), made);
  EXPECT_THAT(page, HasSubstr(".SH FILES\nWhere it is.\n.TP\n\\fB/etc/fence\\fR\nits paint\n"));
  EXPECT_THAT(page, HasSubstr("\\fBpaint\\fR(1),\n\\fBbrush\\fR(7)\n"));
  EXPECT_THAT(page, testing::StartsWith(".TH FENCE 8 "));
}

}  // namespace
}  // namespace veneer::manual
