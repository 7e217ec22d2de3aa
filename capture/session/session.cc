// SPDX-License-Identifier: Apache-2.0
#include "capture/session/session.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

#include "capture/recording.h"
#include "capture/session/bracket.h"
#include "capture/session/rig.h"
#include "capture/session/watch.h"

namespace veneer::capture {
namespace {

using nlohmann::json;

/// What the rig is set to while a bracket is taken.
struct Place {
  Target target = Target::kSample;
  int view = 0;
  int light = 0;
};

std::string in_words(const Place& place) {
  return fmt::format("{}, view {}, light {}", text_of(place.target), place.view, place.light);
}

/// In the order in which they cost the least moving: lights forth and back.
std::vector<Place> places_of(const CapturePlan& plan) {
  std::vector<Place> places;
  bool back = false;
  const auto add = [&](Target target, int views) {
    for (int view = 0; view < views; ++view) {
      const int lights = static_cast<int>(plan.lights.size());
      for (int i = 0; i < lights; ++i) places.push_back({target, view, back ? lights - 1 - i : i});
      back = !back;
    }
  };
  const int views = static_cast<int>(plan.views.size());
  add(Target::kWhite, views);
  if (plan.mirror_light) places.push_back({Target::kMirror, 0, *plan.mirror_light});
  if (plan.light_source == LightSource::kMirrorBall) add(Target::kMirrorBall, 1);
  add(Target::kSample, views);
  return places;
}

/// "12 min", "40 s".
std::string in_words(Duration left) {
  const double seconds = to_seconds(left);
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 90 * 60) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

class Session {
 public:
  Session(Recording& recording, const CaptureDevices& devices, Progress& progress)
      : recording_(recording),
        plan_(recording.plan()),
        devices_(devices),
        progress_(progress),
        rig_(plan_, devices),
        choice_{devices.camera->exposure_range(), plan_.exposure.multiple_of_s},
        analysers_(devices.polariser == nullptr
                       ? 1
                       : static_cast<int>(plan_.polarisation.analyser_rad.size())),
        places_(places_of(plan_)) {
    outcome_.recalled = static_cast<int>(recording.shots().size());
    outcome_.warnings = recording.warnings();
  }

  Result<SessionOutcome> run() {
    VENEER_TRY(choice_.check());
    for (std::size_t i = 0; i < places_.size(); ++i) {
      if (is_finished(places_[i])) continue;
      const Time begin = devices_.clock->now();
      number_ = i;
      if (const Status taken = take(places_[i]); !taken)
        return fail(
            taken.error().code,
            "capturing {}: {}; what is finished is kept, the same command goes on from here",
            in_words(places_[i]),
            taken.error().what);
      spent_ += devices_.clock->now() - begin;
      ++done_;
    }
    return std::move(outcome_);
  }

 private:
  [[nodiscard]] std::string key(const char* what, const Place& place) const {
    return fmt::format("{} {} {} {}", what, text_of(place.target), place.view, place.light);
  }
  [[nodiscard]] std::vector<double> noted_bracket(const Place& place) const {
    const json list = json::parse(recording_.noted(key("bracket", place)), nullptr, false);
    std::vector<double> bracket;
    if (!list.is_array()) return bracket;
    for (const json& each : list) {
      if (each.is_number()) bracket.push_back(each.get<double>());
    }
    return bracket;
  }
  static Shot shot_of(const Place& place, int analyser, std::size_t exposure, bool dark) {
    return {
        place.target, place.view, place.light, analyser, static_cast<int>(exposure), dark, false};
  }
  [[nodiscard]] bool has_all(const Place& place, int analyser, bool dark, std::size_t n) const {
    for (std::size_t i = 0; i < n; ++i) {
      if (!recording_.has(shot_of(place, analyser, i, dark))) return false;
    }
    return true;
  }
  /// Analysers of which a picture is missing.
  [[nodiscard]] std::vector<int> missing(const Place& place, std::size_t exposures) const {
    std::vector<int> result;
    for (int a = 0; a < analysers_; ++a) {
      if (!has_all(place, a, false, exposures)) result.push_back(a);
    }
    return result;
  }
  [[nodiscard]] bool is_finished(const Place& place) const {
    const std::size_t exposures = noted_bracket(place).size();
    return exposures > 0 && has_all(place, 0, true, exposures) && missing(place, exposures).empty();
  }

  /// How much of the light that kept its polarisation is seen behind an analyser.
  [[nodiscard]] double passed(int analyser) const {
    const double angle = plan_.polarisation.analyser_rad[static_cast<std::size_t>(analyser)];
    return std::abs(std::cos(angle));
  }
  [[nodiscard]] int cross() const {
    int best = 0;
    for (int a = 1; a < analysers_; ++a) best = passed(a) < passed(best) ? a : best;
    return best;
  }
  [[nodiscard]] int parallel() const {
    int best = 0;
    for (int a = 1; a < analysers_; ++a) best = passed(a) > passed(best) ? a : best;
    return best;
  }

  std::string label(const Place& place) const {
    std::string text = fmt::format("{} ({} of {})", in_words(place), number_ + 1, places_.size());
    if (done_ == 0) return text;
    const auto rest = std::count_if(places_.begin() + static_cast<std::ptrdiff_t>(number_),
                                    places_.end(),
                                    [this](const Place& each) { return !is_finished(each); });
    return text + fmt::format(", {} left", in_words(spent_ / done_ * rest));
  }

  Status warn(const Place& place, const std::string& text) {
    outcome_.warnings.push_back(fmt::format("{}: {}", in_words(place), text));
    devices_.hands->say(outcome_.warnings.back());
    return {};
  }

  /// Two pictures behind the analyser at which the direction begins and ends.
  Status remember(double exposure_s) {
    VENEER_ASSIGN(first_, rig_.grab(exposure_s));
    VENEER_ASSIGN(again_, rig_.grab(exposure_s));
    reference_s_ = exposure_s;
    return {};
  }

  Status choose_bracket(const Place& place, std::vector<double>& bracket) {
    const Expose expose = [this](double seconds) { return rig_.grab(seconds); };
    const int bright = parallel();
    const int dim = cross();
    // Whichever is nearer comes first.
    const bool dim_first = dim != bright && rig_.analyser() == dim;
    const double start = last_shortest_ > 0 ? last_shortest_ : choice_.at_most(0.01);
    ProbedExposure shortest{start, true};
    ProbedExposure longest{start, true};
    const auto probe_bright = [&]() -> Status {
      VENEER_TRY(rig_.turn_to(bright));
      VENEER_ASSIGN(shortest, longest_unsaturated(expose, choice_, start));
      return {};
    };
    const auto probe_dim = [&]() -> Status {
      VENEER_TRY(rig_.turn_to(dim));
      VENEER_ASSIGN(
          longest, shortest_dim_enough(expose, choice_, longest.exposure_s, most_useful(shortest)));
      return {};
    };
    if (dim_first) {
      VENEER_TRY(probe_dim());
      VENEER_TRY(remember(longest.exposure_s));
      VENEER_TRY(probe_bright());
    } else {
      VENEER_TRY(probe_bright());
      VENEER_TRY(remember(shortest.exposure_s));
      longest.exposure_s = shortest.exposure_s;
      VENEER_TRY(probe_dim());
    }
    if (!shortest.reached)
      VENEER_TRY(warn(place,
                      fmt::format("saturated in the shortest exposure, {:.3g} s; less light, or a "
                                  "smaller aperture",
                                  shortest.exposure_s)));
    last_shortest_ = shortest.exposure_s;
    bracket = bracket_between(shortest.exposure_s, longest.exposure_s, plan_.exposure, choice_);
    return recording_.note(key("bracket", place), json(bracket).dump());
  }
  /// The longest exposure that a bracket can have, where its shortest is known.
  [[nodiscard]] double most_useful(const ProbedExposure& shortest) const {
    return std::min(choice_.range.most_s,
                    shortest.exposure_s * std::pow(plan_.exposure.step, plan_.exposure.most - 1));
  }

  Status take_picture(const Shot& shot, double exposure_s) {
    if (recording_.has(shot)) return {};
    VENEER_ASSIGN(Picture picture, rig_.picture(exposure_s));
    picture.shot = shot;
    VENEER_TRY(recording_.add(picture));
    ++outcome_.taken;
    progress_.advance();
    if (shot.dark || shot.repeat) return {};
    return check_light(picture);
  }

  /// Live: what a look at the picture tells.
  Status check_light(const Picture& picture) {
    const Shot& shot = picture.shot;
    const Place place{shot.target, shot.view, shot.light};
    std::size_t full = 0;
    float brightest = 0;
    for (const Rgb32f& pixel : picture.counts.pixels()) {
      if (pixel.maxCoeff() >= picture.full_scale) ++full;
      brightest = std::max(brightest, pixel.maxCoeff());
    }
    const double part =
        static_cast<double>(full) / static_cast<double>(picture.counts.pixels().size());
    // The mean of several frames shows chance more often than the one that was looked at.
    constexpr double kTooMuch = 10 * kAllowedSaturation;
    if (shot.exposure == 0 && part > kTooMuch)
      return warn(place,
                  fmt::format("{:.2g} % of the pixels are saturated in the shortest exposure "
                              "(analyser {})",
                              part * 100,
                              shot.analyser));
    const std::size_t exposures = noted_bracket(place).size();
    constexpr double kTooDim = 0.1;
    if (static_cast<std::size_t>(shot.exposure) + 1 == exposures && shot.analyser == parallel() &&
        brightest < kTooDim * picture.full_scale)
      return warn(place,
                  fmt::format("too little light: the brightest pixel of the longest exposure, "
                              "{:.3g} s, is at {:.2g} % of full scale",
                              picture.exposure_s,
                              100 * brightest / picture.full_scale));
    return {};
  }

  Status compare(const Place& place) {
    VENEER_ASSIGN(const CameraFrame last, rig_.grab(reference_s_));
    VENEER_ASSIGN(const Change change, change_since(first_, again_, last));
    VENEER_TRY(recording_.note(
        key("movement", place),
        json{{"moved", change.moved()}, {"movement", change.movement}, {"light", change.light}}
            .dump()));
    if (change.moved())
      VENEER_TRY(
          warn(place,
               fmt::format("something moved: the last picture differs from the first by {:.1f} "
                           "times the noise",
                           change.movement)));
    if (change.light_changed())
      VENEER_TRY(
          warn(place,
               fmt::format("the light changed by {:+.1f} % from the first picture to the last",
                           100 * (change.light - 1))));
    return {};
  }

  Status take(const Place& place) {
    std::vector<double> bracket = noted_bracket(place);
    progress_.start(label(place), expected(bracket.size(), place));
    VENEER_TRY(rig_.place(place.target, place.view, place.light));
    const bool is_new = bracket.empty();
    if (is_new) {
      VENEER_TRY(rig_.lit(true));
      const bool dim_first = cross() != parallel() && rig_.analyser() == cross();
      begin_ = dim_first ? cross() : parallel();
      VENEER_TRY(choose_bracket(place, bracket));
      progress_.start(label(place), expected(bracket.size(), place));
    }
    std::vector<int> order = missing(place, bracket.size());
    if (!is_new && !order.empty()) {
      const bool is_there = rig_.analyser() && std::ranges::count(order, *rig_.analyser()) > 0;
      begin_ = is_there ? *rig_.analyser() : order.front();
      VENEER_TRY(rig_.lit(true));
      VENEER_TRY(rig_.turn_to(begin_));
      VENEER_TRY(remember(bracket.front()));
    }
    if (!has_all(place, 0, true, bracket.size())) {
      VENEER_TRY(rig_.lit(false));
      for (std::size_t i = 0; i < bracket.size(); ++i)
        VENEER_TRY(take_picture(shot_of(place, 0, i, true), bracket[i]));
    }
    if (!order.empty()) {
      VENEER_TRY(rig_.lit(true));
      // From where it is, and to the end where it began.
      std::ranges::stable_sort(order, {}, [this](int a) {
        return a == begin_ ? 2 : rig_.analyser() == a ? 0 : 1;
      });
      for (const int analyser : order) {
        VENEER_TRY(rig_.turn_to(analyser));
        for (std::size_t i = 0; i < bracket.size(); ++i)
          VENEER_TRY(take_picture(shot_of(place, analyser, i, false), bracket[i]));
      }
      VENEER_TRY(compare(place));
      Shot repeat = shot_of(place, begin_, 0, false);
      repeat.repeat = true;
      VENEER_TRY(take_picture(repeat, bracket.front()));
    }
    progress_.finish();
    return {};
  }

  [[nodiscard]] std::int64_t expected(std::size_t exposures, const Place& place) const {
    const std::size_t each =
        exposures > 0 ? exposures : static_cast<std::size_t>(plan_.exposure.most);
    std::int64_t count = 1;  // the repeat
    for (std::size_t i = 0; i < each; ++i) {
      for (int a = 0; a < analysers_; ++a)
        count += recording_.has(shot_of(place, a, i, false)) ? 0 : 1;
      count += recording_.has(shot_of(place, 0, i, true)) ? 0 : 1;
    }
    return count;
  }

  Recording& recording_;
  const CapturePlan& plan_;
  const CaptureDevices& devices_;
  Progress& progress_;
  Rig rig_;
  ExposureChoice choice_;
  int analysers_;
  std::vector<Place> places_;
  SessionOutcome outcome_;

  std::size_t number_ = 0;     // of the place
  int done_ = 0;               // places, this time
  Duration spent_{};           // on them
  double last_shortest_ = 0;   // a good guess for the next place
  int begin_ = 0;              // the analyser with which a place begins and ends
  CameraFrame first_, again_;  // there, at the beginning
  double reference_s_ = 0;
};

}  // namespace

Result<SessionOutcome> run_session(const CapturePlan& plan,
                                   const std::filesystem::path& folder,
                                   const CaptureDevices& devices,
                                   Progress& progress) {
  VENEER_CHECK(devices.camera != nullptr && devices.hands != nullptr && devices.clock != nullptr);
  VENEER_TRY(plan.check());
  if (plan.lights.empty())
    return fail(Errc::kInvalidOption,
                "capturing into {}: the plan has no lights; with a projector's profile they come "
                "from its pose",
                folder.string());
  VENEER_ASSIGN(Recording recording,
                Recording::resume(folder, plan, devices.camera->description()));
  return Session(recording, devices, progress).run();
}

}  // namespace veneer::capture
