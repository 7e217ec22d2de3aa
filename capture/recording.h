// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/camera.h"
#include "capture/hands.h"
#include "capture/plan.h"

namespace veneer::capture {

/// Which picture of a session.
struct Shot {
  Target target = Target::kSample;
  int view = 0;
  int light = 0;
  /// Index into PolarisationAxes::analyser_rad; 0 where the sensor has its analysers on it.
  int analyser = 0;
  int exposure = 0;   ///< index into the bracket, shortest first
  bool dark = false;  ///< without the projector's light: room light, dark current, fixed pattern
  /// The first picture of a direction once more at its end: tells movement, drift and noise.
  bool repeat = false;

  friend bool operator==(const Shot&, const Shot&) = default;
  friend auto operator<=>(const Shot&, const Shot&) = default;
};

/// What was photographed: the mean of some frames.
struct Picture {
  Shot shot;
  /// Counts as in CameraFrame. A pixel's channel that was saturated in any of the frames is
  /// full_scale.
  Image<Rgb32f> counts;
  double full_scale = 65535;
  double exposure_s = 0;
  int frames = 1;  ///< that were averaged
  Mosaic mosaic = Mosaic::kNone;
  Time time;  ///< of the first frame
};

/// The folder of a capture session: plan and camera as they were at its beginning, pictures as EXR
/// with their metadata, journal.jsonl of what is done.
///
///     NAME/session.json                                        identity: plan, camera, version
///     NAME/journal.jsonl                                       one line a finished picture, a note
///     NAME/sample/view-00/light-12/analyser-0-exposure-2.exr   and -dark, -repeat
///
/// A picture counts once its journal line is on the disk: whatever was interrupted before is taken
/// again. One thread, one program at a time.
class Recording {
 public:
  /// Begins a session or goes on with one; pictures whose file is gone or of another size are not
  /// finished then, see warnings(). Errors: kInvalidOption (the folder holds a session of another
  /// plan or camera, and in what they differ, or something that is no session), kBadFormat (a
  /// damaged journal, a session of a newer version), kUnavailable (another program has it open),
  /// kIo.
  [[nodiscard]] static Result<Recording> resume(const std::filesystem::path& folder,
                                                const CapturePlan& plan,
                                                const std::string& camera);
  /// Reads one, while it is being taken too; nothing can be added to it. Errors: kNotFound,
  /// kBadFormat, kIo.
  [[nodiscard]] static Result<Recording> open(const std::filesystem::path& folder);
  Recording(Recording&&) noexcept;
  ~Recording();

  [[nodiscard]] const CapturePlan& plan() const;
  [[nodiscard]] const std::filesystem::path& folder() const;
  [[nodiscard]] const std::string& camera() const;
  /// What was found amiss when it was opened.
  [[nodiscard]] const std::vector<std::string>& warnings() const;
  /// Finished ones, sorted.
  [[nodiscard]] std::vector<Shot> shots() const;
  [[nodiscard]] bool has(const Shot& shot) const;
  /// Where its EXR is or will be.
  [[nodiscard]] std::filesystem::path path_of(const Shot& shot) const;
  /// On the disk on return; on an error nothing of it counts. Errors: kIo (disk full, for example).
  [[nodiscard]] Status add(const Picture& picture);
  /// Errors: kNotFound, kBadFormat (a picture that was changed or damaged since).
  [[nodiscard]] Result<Picture> picture(const Shot& shot) const;
  /// What else is to be known later, kept as lines of the journal. The session notes
  /// "bracket sample 0 12" (target, view, light; the exposures in seconds, shortest first) and
  /// "movement sample 0 12" (see run_session()). Errors: kInvalidOption (no JSON), kIo.
  [[nodiscard]] Status note(const std::string& key, const std::string& json);
  /// The latest of that key; empty where there is none.
  [[nodiscard]] std::string noted(const std::string& key) const;

 private:
  struct State;
  explicit Recording(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::capture
