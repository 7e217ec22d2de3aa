// SPDX-License-Identifier: Apache-2.0
#include "service/journal/journal.h"

#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/uio.h>
#include <syslog.h>
#include <unistd.h>

// Without this the place of every call of ours would be sent, not that of the logging line.
#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

#include <cstdlib>
#include <mutex>
#include <utility>

#include "service/journal/internal_journal.h"

namespace veneer::service {
namespace {

thread_local std::vector<std::string> t_fields;

/// Gives its fields to what is logged while it lives.
class WithFields {
 public:
  explicit WithFields(std::vector<std::string> fields) { t_fields = std::move(fields); }
  ~WithFields() { t_fields.clear(); }
  WithFields(const WithFields&) = delete;
  WithFields& operator=(const WithFields&) = delete;
};

int priority_of(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::critical:
      return LOG_CRIT;
    case spdlog::level::err:
      return LOG_ERR;
    case spdlog::level::warn:
      return LOG_WARNING;
    case spdlog::level::info:
      return LOG_INFO;
    default:
      return LOG_DEBUG;
  }
}

class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit JournalSink(std::string identifier) : identifier_(std::move(identifier)) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    std::vector<std::string> fields =
        journal_fields(identifier_,
                       message.level,
                       {message.payload.data(), message.payload.size()},
                       message.source.filename == nullptr ? "" : message.source.filename,
                       message.source.line,
                       fields_of_this_line());
    std::vector<iovec> parts;
    for (std::string& each : fields) parts.push_back({each.data(), each.size()});
    // Where it fails there is no better place to say so.
    ::sd_journal_sendv(parts.data(), static_cast<int>(parts.size()));
  }
  void flush_() override {}

  std::string identifier_;
};

bool stderr_is_the_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat file {};
  return stream != nullptr && ::fstat(STDERR_FILENO, &file) == 0 && names_file(stream, file);
}

spdlog::level::level_enum level_of(State state) {
  switch (state) {
    case State::kFault:
      return spdlog::level::err;
    case State::kDegraded:
    case State::kBlank:
      return spdlog::level::warn;
    default:
      return spdlog::level::info;
  }
}

}  // namespace

bool names_file(std::string_view journal_stream, const struct stat& file) {
  return journal_stream == fmt::format("{}:{}", file.st_dev, file.st_ino);
}

void log_as(const std::string& identifier) {
  if (stderr_is_the_journal()) {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>(identifier, std::make_shared<JournalSink>(identifier)));
    return;
  }
  spdlog::set_default_logger(spdlog::stderr_color_mt(identifier));
  spdlog::set_pattern("%n %^%l%$: %v");
}

void log_fault(const Fault& fault, bool begun) {
  const WithFields fields({fmt::format("VENEER_FAULT={}", name_of(fault.kind)),
                           fmt::format("VENEER_FAULT_BEGUN={}", begun ? 1 : 0)});
  if (begun) {
    spdlog::log(level_of(effect_of(fault.kind)), "{}: {}", name_of(fault.kind), fault.text);
  } else {
    spdlog::info("{}: over: {}", name_of(fault.kind), fault.text);
  }
}

void log_state(State state, std::string_view why) {
  const WithFields fields({fmt::format("VENEER_STATE={}", name_of(state))});
  spdlog::log(level_of(state), "{}{}{}", name_of(state), why.empty() ? "" : ": ", why);
}

std::vector<std::string> journal_fields(std::string_view identifier,
                                        spdlog::level::level_enum level,
                                        std::string_view text,
                                        std::string_view file,
                                        int line,
                                        const std::vector<std::string>& extra) {
  std::vector<std::string> fields{fmt::format("MESSAGE={}", text),
                                  fmt::format("PRIORITY={}", priority_of(level)),
                                  fmt::format("SYSLOG_IDENTIFIER={}", identifier)};
  if (!file.empty()) {
    fields.push_back(fmt::format("CODE_FILE={}", file));
    fields.push_back(fmt::format("CODE_LINE={}", line));
  }
  fields.insert(fields.end(), extra.begin(), extra.end());
  return fields;
}

const std::vector<std::string>& fields_of_this_line() { return t_fields; }

}  // namespace veneer::service
