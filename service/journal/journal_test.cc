// SPDX-License-Identifier: Apache-2.0
#include "service/journal/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <mutex>
#include <thread>

#include "base/result.h"
#include "base/unique_handle.h"
#include "service/journal/internal_journal.h"

namespace veneer::service {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(JournalFields, SayLevelTextAndPlace) {
  EXPECT_THAT(journal_fields("veneerd", spdlog::level::warn, "a\nb = c", "", 0, {}),
              ElementsAre("MESSAGE=a\nb = c", "PRIORITY=4", "SYSLOG_IDENTIFIER=veneerd"));
  EXPECT_THAT(
      journal_fields("x", spdlog::level::info, "", "daemon/a.cc", 7, {"VENEER_STATE=blank"}),
      ElementsAre("MESSAGE=",
                  "PRIORITY=6",
                  "SYSLOG_IDENTIFIER=x",
                  "CODE_FILE=daemon/a.cc",
                  "CODE_LINE=7",
                  "VENEER_STATE=blank"));
}

TEST(JournalFields, RankLevelsAsSyslogDoes) {
  int before = 8;
  for (const auto level : {spdlog::level::debug,
                           spdlog::level::info,
                           spdlog::level::warn,
                           spdlog::level::err,
                           spdlog::level::critical}) {
    const std::string priority = journal_fields("x", level, "", "", 0, {}).at(1);
    const int value = std::stoi(priority.substr(priority.find('=') + 1));
    EXPECT_LT(value, before) << priority;
    before = value;
  }
  EXPECT_GE(before, 2) << "0 and 1 are the machine's own";
}

/// Keeps what a journal would be sent.
class KeepingSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  std::vector<std::vector<std::string>> lines;

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    lines.push_back(journal_fields("veneerd",
                                   message.level,
                                   {message.payload.data(), message.payload.size()},
                                   "",
                                   0,
                                   fields_of_this_line()));
  }
  void flush_() override {}
};

class JournalTest : public testing::Test {
 protected:
  JournalTest() : before_(spdlog::default_logger()), sink_(std::make_shared<KeepingSink>()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink_));
  }
  ~JournalTest() override { spdlog::set_default_logger(before_); }

  std::shared_ptr<spdlog::logger> before_;
  std::shared_ptr<KeepingSink> sink_;
};

TEST_F(JournalTest, FindsFaultsAndStatesByTheirFields) {
  log_fault({FaultKind::kTracker, Time{}, "no poses; is it plugged in?"}, true);
  log_fault({FaultKind::kOutput, Time{}, "gone"}, true);
  log_fault({FaultKind::kTracker, Time{}, "no poses"}, false);
  log_state(State::kBlank, "asked for");
  log_state(State::kRunning);
  spdlog::info("something else");
  EXPECT_THAT(
      sink_->lines,
      ElementsAre(
          ElementsAre("MESSAGE=tracker: no poses; is it plugged in?",
                      "PRIORITY=4",
                      "SYSLOG_IDENTIFIER=veneerd",
                      "VENEER_FAULT=tracker",
                      "VENEER_FAULT_BEGUN=1"),
          ElementsAre("MESSAGE=output: gone",
                      "PRIORITY=3",
                      "SYSLOG_IDENTIFIER=veneerd",
                      "VENEER_FAULT=output",
                      "VENEER_FAULT_BEGUN=1"),
          ElementsAre("MESSAGE=tracker: over: no poses",
                      "PRIORITY=6",
                      "SYSLOG_IDENTIFIER=veneerd",
                      "VENEER_FAULT=tracker",
                      "VENEER_FAULT_BEGUN=0"),
          ElementsAre("MESSAGE=blank: asked for",
                      "PRIORITY=4",
                      "SYSLOG_IDENTIFIER=veneerd",
                      "VENEER_STATE=blank"),
          ElementsAre(
              "MESSAGE=running", "PRIORITY=6", "SYSLOG_IDENTIFIER=veneerd", "VENEER_STATE=running"),
          ElementsAre("MESSAGE=something else", "PRIORITY=6", "SYSLOG_IDENTIFIER=veneerd")));
  EXPECT_THAT(fields_of_this_line(), IsEmpty());
}

TEST(JournalStream, NamesOneFileAndNoOther) {
  int ends[2] = {-1, -1};
  ASSERT_EQ(::pipe(ends), 0);
  const UniqueFd from(ends[0]);
  const UniqueFd to(ends[1]);
  struct stat file {};
  ASSERT_EQ(::fstat(to.value(), &file), 0);
  const std::string name = fmt::format("{}:{}", file.st_dev, file.st_ino);
  EXPECT_TRUE(names_file(name, file));
  for (const std::string& other : {std::string(),
                                   std::string(":"),
                                   name + "0",
                                   "1" + name,
                                   fmt::format("{}:{}", file.st_ino, file.st_dev)})
    EXPECT_FALSE(names_file(other, file)) << other;
}

/// What a program with this JOURNAL_STREAM writes to standard error, a pipe. "SELF" stands for
/// that pipe's own name.
std::string written_to_stderr(std::string journal_stream) {
  int ends[2] = {-1, -1};
  VENEER_CHECK(::pipe(ends) == 0);
  const UniqueFd from(ends[0]);
  UniqueFd to(ends[1]);
  struct stat file {};
  ::fstat(to.value(), &file);
  if (journal_stream == "SELF") journal_stream = fmt::format("{}:{}", file.st_dev, file.st_ino);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(to.value(), STDERR_FILENO);
    ::setenv("JOURNAL_STREAM", journal_stream.c_str(), 1);
    log_as("veneerd-test");
    spdlog::warn("watch out");
    spdlog::default_logger()->flush();
    ::_exit(0);
  }
  to.reset();
  std::string text;
  char buffer[512];
  for (ssize_t n = 0; (n = ::read(from.value(), buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  ::waitpid(child, nullptr, 0);
  return text;
}

TEST(Log, GoesToStandardErrorUnlessThatIsTheJournal) {
  EXPECT_EQ(written_to_stderr("1:1"), "veneerd-test warning: watch out\n");
  EXPECT_EQ(written_to_stderr("SELF"), "");
}

}  // namespace
}  // namespace veneer::service
