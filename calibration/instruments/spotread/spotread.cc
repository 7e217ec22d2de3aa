// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/spotread/spotread.h"

#include <algorithm>
#include <utility>

namespace veneer::calibration {
namespace {

using spotread::Event;

/// After it was asked to end, or has closed its terminal.
constexpr Duration kFarewell = std::chrono::seconds(2);
/// Events in one reading after which the two of us talk in circles.
constexpr int kMostEvents = 100;
constexpr std::string_view kStarting = "starting spotread";
constexpr std::string_view kReading = "reading with spotread";

}  // namespace

Status SpotreadOptions::check() const {
  if (program.empty())
    return fail(Errc::kInvalidOption, "starting spotread: program is empty; name one");
  if (port < 0 || port > 99)
    return fail(Errc::kInvalidOption,
                "starting spotread: port is {}; set it to a number of `spotread -?`, or 0",
                port);
  const bool is_letters = std::ranges::all_of(display_type, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  });
  if (!is_letters || display_type.size() > 8)
    return fail(Errc::kInvalidOption,
                "starting spotread: display_type is \"{}\"; set it to the letter that "
                "`spotread -?` gives after -y",
                display_type);
  if (start_limit <= Duration{} || reading_limit <= Duration{})
    return fail(Errc::kInvalidOption, "starting spotread: the time limits must be above 0");
  if (retries < 0 || retries > 100)
    return fail(
        Errc::kInvalidOption, "starting spotread: retries is {}; set it from 0 to 100", retries);
  return {};
}

Spotread::Spotread(SpotreadOptions options, Ask ask, Clock& clock)
    : options_(std::move(options)), ask_(std::move(ask)), clock_(clock) {}

Result<std::unique_ptr<Spotread>> Spotread::open(const SpotreadOptions& options,
                                                 Ask ask,
                                                 Clock& clock) {
  VENEER_TRY(options.check());
  std::unique_ptr<Spotread> instrument(new Spotread(options, std::move(ask), clock));
  VENEER_TRY(instrument->start());
  return instrument;
}

Status Spotread::start() {
  // Emission, absolute: cd/m^2 of what the instrument looks at.
  std::vector<std::string> arguments{options_.program.string(), "-e"};
  if (!options_.display_type.empty()) arguments.push_back("-y" + options_.display_type);
  if (options_.port > 0) {
    arguments.emplace_back("-c");
    arguments.push_back(std::to_string(options_.port));
  }
  if (!options_.correction.empty()) {
    arguments.emplace_back("-X");
    arguments.push_back(options_.correction.string());
  }
  output_ = {};
  is_ready_ = false;
  // With this it takes keys by the line, and prints every prompt at once.
  VENEER_ASSIGN(ChildTerminal child,
                ChildTerminal::start(arguments, {"ARGYLL_NOT_INTERACTIVE=1", "LC_ALL=C"}));
  child_.emplace(std::move(child));
  Time deadline = clock_.now() + options_.start_limit;
  int retries = options_.retries;
  for (int events = 0; !is_ready_; ++events) {
    VENEER_ASSIGN(const Event event, next_event(deadline, kStarting));
    if (event.kind == Event::Kind::kReady) {
      is_ready_ = true;
    } else if (event.kind == Event::Kind::kResult || events == kMostEvents) {
      return give_up(Errc::kBadFormat, kStarting, "it prints what was not asked for");
    } else {
      VENEER_TRY(answer(event, kStarting, retries));
      deadline = clock_.now() + options_.start_limit;  // a person may have taken longer
    }
  }
  return {};
}

std::string Spotread::description() const {
  return fmt::format("ArgyllCMS {}{}",
                     options_.program.filename().string(),
                     options_.port > 0 ? fmt::format(", port {}", options_.port) : "");
}

std::optional<pid_t> Spotread::process() const { return child_ ? child_->process() : std::nullopt; }

Status Spotread::press(std::string_view key) { return child_->write(std::string(key) + "\n"); }

tl::unexpected<Error> Spotread::give_up(Errc code, std::string_view doing, std::string why) {
  child_.reset();
  is_ready_ = false;
  return tl::unexpected<Error>(Error{code, fmt::format("{}: {}", doing, why)});
}

Result<Event> Spotread::next_event(Time deadline, std::string_view doing) {
  for (;;) {
    if (std::optional<Event> event = output_.next()) return *std::move(event);
    const Result<std::string> printed = child_->read(deadline, clock_);
    if (printed) {
      output_.feed(*printed);
      continue;
    }
    const std::string complaint = output_.complaint();
    const std::string said =
        complaint.empty() ? "it said nothing" : fmt::format("it said: \"{}\"", complaint);
    if (printed.error().code == Errc::kTimeout)
      return give_up(Errc::kTimeout,
                     doing,
                     fmt::format("it hangs ({}) and was killed; try again, and plug the instrument "
                                 "out and in if this lasts",
                                 said));
    const std::string end = child_->finish(clock_.now() + kFarewell, clock_);
    const bool is_start = doing == kStarting;
    return give_up(is_start ? Errc::kNotFound : Errc::kDisconnected,
                   doing,
                   fmt::format("it {} ({}); see that the instrument is plugged in, that `spotread "
                               "-?` lists it and that no other program holds it",
                               end,
                               said));
  }
}

Status Spotread::answer(const Event& event, std::string_view doing, int& retries) {
  switch (event.kind) {
    case Event::Kind::kAction: {
      if (!ask_)
        return give_up(Errc::kUnavailable,
                       doing,
                       fmt::format("the instrument needs a person (\"{}\") and there is none; run "
                                   "it from a terminal",
                                   event.text));
      if (const Status done = ask_(event.text); !done)
        return give_up(done.error().code, doing, done.error().what);
      break;
    }
    case Event::Kind::kRetry:
      if (event.text.find("communication") != std::string::npos ||
          event.text.find("Communications") != std::string::npos)
        return give_up(
            Errc::kDisconnected,
            doing,
            fmt::format("it lost the instrument (\"{}\"); plug it out and in again", event.text));
      if (retries-- <= 0)
        return give_up(Errc::kTimeout,
                       doing,
                       fmt::format("it fails again and again (\"{}\"); see that the instrument "
                                   "looks at the spot and lies still",
                                   event.text));
      break;
    case Event::Kind::kSavedReading:
      return press("N");  // of another time: not to be used
    case Event::Kind::kFatal:
      return give_up(event.text.find("o instrument") != std::string::npos ? Errc::kNotFound
                                                                          : Errc::kUnavailable,
                     doing,
                     fmt::format("{}; see that the instrument is plugged in, that `spotread -?` "
                                 "lists it and that no other program holds it",
                                 event.text));
    case Event::Kind::kReady:
    case Event::Kind::kResult:
      return {};
  }
  if (const Status pressed = press(" "); !pressed)
    return give_up(pressed.error().code, doing, pressed.error().what);
  return {};
}

Result<Xyz> Spotread::read(Target /*target*/, const Eigen::Vector2d& /*pixel*/) {
  if (!child_) VENEER_TRY(start());
  Time deadline = clock_.now() + options_.reading_limit;
  int retries = options_.retries;
  // After a reading its next prompt may not have been seen yet.
  bool is_asked = false;
  for (int events = 0; events < kMostEvents; ++events) {
    if (is_ready_ && !is_asked) {
      if (const Status pressed = press(" "); !pressed)
        return give_up(pressed.error().code, kReading, pressed.error().what);
      is_ready_ = false;
      is_asked = true;
    }
    VENEER_ASSIGN(const Event event, next_event(deadline, kReading));
    switch (event.kind) {
      case Event::Kind::kResult:
        if (!is_asked)
          return give_up(Errc::kBadFormat, kReading, "it prints a reading that was not asked for");
        return event.xyz;
      case Event::Kind::kReady:
        // Back at the prompt without a reading: the sensor was in the wrong position, or it has
        // calibrated instead.
        is_ready_ = true;
        if (!is_asked) break;
        is_asked = false;
        if (retries-- <= 0)
          return give_up(Errc::kTimeout,
                         kReading,
                         fmt::format("it gives no reading (\"{}\"); see that the instrument is set "
                                     "for emission and looks at the spot",
                                     event.text));
        if (event.text.find("wrong position") == std::string::npos) break;
        if (!ask_)
          return give_up(Errc::kUnavailable,
                         kReading,
                         fmt::format("the instrument's sensor is in the wrong position (\"{}\"); "
                                     "turn it to where it measures light",
                                     event.text));
        if (const Status done = ask_("Turn the sensor to where it measures light: " + event.text);
            !done)
          return give_up(done.error().code, kReading, done.error().what);
        deadline = clock_.now() + options_.reading_limit;
        break;
      default:
        VENEER_TRY(answer(event, kReading, retries));
        deadline = clock_.now() + options_.reading_limit;
    }
  }
  return give_up(Errc::kBadFormat, kReading, "it prints what makes no sense");
}

}  // namespace veneer::calibration
