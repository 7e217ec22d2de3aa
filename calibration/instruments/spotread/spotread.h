// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/instruments/spotread/child_terminal.h"
#include "calibration/instruments/spotread/spotread_output.h"

namespace veneer::calibration {

struct SpotreadOptions {
  std::filesystem::path program = "spotread";  ///< looked for in PATH
  int port = 0;  ///< its -c, as `spotread -?` lists them from 1; 0: the first
  /// Its -y, which kinds of display an instrument knows: "p" is the projector where it has one.
  /// Empty: not said.
  std::string display_type = "p";
  std::filesystem::path correction;                   ///< its -X, a .ccmx or .ccss; empty: none
  Duration start_limit = std::chrono::seconds(60);    ///< until it is ready for the first reading
  Duration reading_limit = std::chrono::seconds(60);  ///< dark readings of some take half a minute
  int retries = 3;                                    ///< of a misread; 0 to 100
  [[nodiscard]] Status check() const;
};

/// Every instrument that ArgyllCMS can drive, through its program `spotread`, which is kept running
/// from reading to reading. It is killed when this goes, when it hangs and when it makes no sense.
class Spotread final : public Colorimeter {
 public:
  /// See InstrumentServices::ask.
  using Ask = std::function<Status(const std::string& what_to_do)>;

  /// Starts it and waits until it is ready, the calibration of the instrument included.
  /// @param clock  borrowed; must outlive it.
  /// Errors: kNotFound (no program, no instrument), kTimeout (it hangs), kUnavailable (the
  /// instrument needs a person and there is none; it will not work), kCancelled, kInvalidOption.
  [[nodiscard]] static Result<std::unique_ptr<Spotread>> open(const SpotreadOptions& options,
                                                              Ask ask,
                                                              Clock& clock);
  [[nodiscard]] std::string description() const override;
  /// Errors: kTimeout (hung, or misread again and again; it starts afresh at the next call),
  /// kDisconnected (final: the program has ended or has lost the instrument), kUnavailable and
  /// kCancelled as above, kBadFormat (it prints what is no reading).
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;
  /// The running program's; for tests.
  [[nodiscard]] std::optional<pid_t> process() const;

 private:
  Spotread(SpotreadOptions options, Ask ask, Clock& clock);
  [[nodiscard]] Status start();
  [[nodiscard]] Status press(std::string_view key);
  /// The next event, before `deadline`. An error has ended the program.
  [[nodiscard]] Result<spotread::Event> next_event(Time deadline, std::string_view doing);
  /// Answers what is neither a result nor ready; says whether to go on.
  [[nodiscard]] Status answer(const spotread::Event& event, std::string_view doing, int& retries);
  [[nodiscard]] tl::unexpected<Error> give_up(Errc code, std::string_view doing, std::string why);

  SpotreadOptions options_;
  Ask ask_;
  Clock& clock_;
  std::optional<ChildTerminal> child_;
  spotread::Output output_;
  bool is_ready_ = false;
};

}  // namespace veneer::calibration
