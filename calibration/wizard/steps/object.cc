// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "calibration/wizard/steps/internal_geometry.h"
#include "calibration/wizard/steps/internal_patches.h"

namespace veneer::calibration {
namespace {

using nlohmann::json;

/// Fewer leave a turning open or are no check of each other.
constexpr std::size_t kLeastTouches = 4;

/// A touched point in the journal; null for one that was skipped.
json to_json(const PointProbe::Point& point) {
  return {point.x_in_world.x(), point.x_in_world.y(), point.x_in_world.z(), point.deviation_m};
}
bool is_point(const json* value) {
  return value != nullptr && value->is_array() && value->size() == 4 &&
         std::ranges::all_of(*value, [](const json& each) { return each.is_number(); });
}
PointProbe::Point point_from(const json& value) {
  return {{value[0].get<double>(), value[1].get<double>(), value[2].get<double>()},
          value[3].get<double>()};
}

/// Touches what `request` says, or recalls it. A point that was skipped is left empty.
Result<Answer> touch(StepContext& context,
                     const std::string& key,
                     const Request& request,
                     std::optional<PointProbe::Point>& point) {
  const json* known = context.journal.find("object", key);
  if (is_point(known)) {
    point = point_from(*known);
    return Answer::kDone;
  }
  if (known != nullptr && known->is_null()) return Answer::kDone;
  VENEER_ASSIGN(const Answer answer, context.devices.hands->please(request));
  if (answer == Answer::kSkip) {
    VENEER_TRY(context.journal.add("object", key, nullptr));
    return Answer::kDone;
  }
  if (answer != Answer::kDone) return answer;
  VENEER_ASSIGN(point, context.devices.stylus->measure());
  VENEER_TRY(context.journal.add("object", key, to_json(*point)));
  return Answer::kDone;
}

Result<Answer> touch_landmarks(StepContext& context) {
  std::vector<geometry::PointPair> pairs;
  for (std::size_t i = 0; i < context.options.landmarks.size(); ++i) {
    const Landmark& landmark = context.options.landmarks[i];
    std::optional<PointProbe::Point> point;
    VENEER_ASSIGN(const Answer answer,
                  touch(context,
                        "landmark " + landmark.name,
                        {Task::kTouch,
                         static_cast<int>(i),
                         fmt::format("Touch this point of the object with the stylus and hold "
                                     "still: {}. (s: leave it out)",
                                     landmark.name)},
                        point));
    if (answer != Answer::kDone) return answer;
    if (point) pairs.push_back({landmark.in_object, point->x_in_world, point->deviation_m});
  }
  if (pairs.size() < kLeastTouches) {
    if (!pairs.empty())
      context.find({Finding::Severity::kNote,
                    fmt::format("only {} landmarks were touched; {} are needed to place the object",
                                pairs.size(),
                                kLeastTouches),
                    ""});
    return Answer::kDone;
  }
  VENEER_ASSIGN(context.results.object, geometry::register_points(pairs));
  for (const std::string& warning : context.results.object->warnings)
    context.find({Finding::Severity::kNote, warning, ""});
  return Answer::kDone;
}

/// White lines three pixels wide that cross at the middle of a pixel.
Image<Rgb16> cross_hair(const Devices& devices, int at_x, int at_y) {
  constexpr int kHalfWidth = 1;
  const int arm = std::max(8, devices.height / 20);
  const Rgb16 white = grey(full_code(devices));
  Image<Rgb16> picture(devices.width, devices.height);
  for (int y = 0; y < devices.height; ++y) {
    for (int x = 0; x < devices.width; ++x) {
      const int dx = std::abs(x - at_x);
      const int dy = std::abs(y - at_y);
      if ((dx <= kHalfWidth && dy <= arm) || (dy <= kHalfWidth && dx <= arm)) picture(x, y) = white;
    }
  }
  return picture;
}

/// Cross-hairs over the picture; each that falls on the object is touched.
Result<Answer> touch_cross_hairs(StepContext& context) {
  WizardResults& results = context.results;
  Devices& devices = context.devices;
  const int count = context.options.cross_hairs;
  results.cross_hairs.clear();
  for (int i = 0; i < count * count; ++i) {
    const int x = static_cast<int>(devices.width * (i % count + 0.5) / count);
    const int y = static_cast<int>(devices.height * (i / count + 0.5) / count);
    const Eigen::Vector2d pixel(x + 0.5, y + 0.5);
    const std::string key = fmt::format("cross-hair {},{}", x, y);
    if (context.journal.find("object", key) == nullptr) {
      const Image<Rgb16> picture = cross_hair(devices, x, y);
      VENEER_TRY(devices.display->show_picture(picture.view()));
    }
    std::optional<PointProbe::Point> point;
    VENEER_ASSIGN(
        const Answer answer,
        touch(context,
              key,
              {Task::kTouchSpot,
               i,
               fmt::format("Touch the middle of the cross-hair on the object and hold still, {} of "
                           "{}. (s: it does not fall on the object)",
                           i + 1,
                           count * count),
               pixel},
              point));
    if (answer != Answer::kDone) return answer;
    if (point) results.cross_hairs.push_back({pixel, point->x_in_world, point->deviation_m});
  }
  if (results.cross_hairs.size() < kLeastTouches) {
    if (!results.cross_hairs.empty())
      context.find({Finding::Severity::kNote,
                    fmt::format("only {} cross-hairs were touched; {} are needed to be of use",
                                results.cross_hairs.size(),
                                kLeastTouches),
                    ""});
    results.cross_hairs.clear();
  }
  VENEER_TRY(tie_to_tracker(context));  // without any it goes by the board alone
  return Answer::kDone;
}

}  // namespace

Result<Answer> register_object(StepContext& context) {
  WizardResults& results = context.results;
  if (context.devices.stylus == nullptr) {
    context.report.summary = "there is no tracked stylus: the scene says where the object is";
    return Answer::kSkip;
  }
  results.object.reset();
  VENEER_ASSIGN(const Answer landmarks, touch_landmarks(context));
  if (landmarks != Answer::kDone) return landmarks;
  // Where nothing tracks the board there is no world that the cross-hairs could be in.
  if (results.registration) {
    VENEER_ASSIGN(const Answer cross_hairs, touch_cross_hairs(context));
    if (cross_hairs != Answer::kDone) return cross_hairs;
  }
  std::string& summary = context.report.summary;
  if (results.object)
    summary = fmt::format("landmarks {:.2f} mm rms, one that the fit did not see {:.2f} mm",
                          1e3 * results.object->rms_m,
                          1e3 * results.object->held_out_m);
  if (!results.cross_hairs.empty())
    summary += fmt::format("{}{} cross-hairs are touched {:.2f} px from where they are shown",
                           summary.empty() ? "" : "; ",
                           results.cross_hairs.size(),
                           results.tied->touch_rms_px);
  if (summary.empty()) summary = "nothing was touched: the scene says where the object is";
  return Answer::kDone;
}

}  // namespace veneer::calibration
